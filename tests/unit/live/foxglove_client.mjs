// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// A client of another house: npm's ws, and Foxglove's own parser and reader of CDR.
//   node foxglove_client.mjs NODE_MODULES URL SUBPROTOCOL TOPIC COUNT CDR_JS
// Prints what the server says, and COUNT messages of TOPIC as JSON; compares with what the live view's own
// page reads of the same bytes.
import { createRequire } from "node:module";
const [modules, url, subprotocol, topic, count, cdrFile] = process.argv.slice(2);
const require = createRequire(modules + "/");
const { WebSocket } = require("ws");
const { parse } = require("@foxglove/rosmsg");
const { parseSchema, decodeCdr } = require(cdrFile);
const { MessageReader } = require("@foxglove/rosmsg2-serialization");

const client = new WebSocket(url, [subprotocol]);
client.binaryType = "arraybuffer";
let reader;
let ownTypes;
let left = Number(count);
const plain = (_, value) =>
  typeof value === "bigint" ? Number(value) : ArrayBuffer.isView(value) ? Array.from(value) : value;

function onText(message) {
  if (message.op === "serverInfo") {
    console.log("subprotocol " + client.protocol);
    console.log("capabilities " + message.capabilities.join(","));
  } else if (message.op === "advertise") {
    for (const channel of message.channels) {
      parse(channel.schema, { ros2: true }); // throws when it is no schema
      console.log(`channel ${channel.topic} ${channel.schemaName} ${channel.encoding} ${channel.schemaEncoding}`);
    }
    const wanted = message.channels.find((channel) => channel.topic === topic);
    reader = new MessageReader(parse(wanted.schema, { ros2: true }));
    ownTypes = parseSchema(wanted.schema);
    client.send(JSON.stringify({ op: "subscribe", subscriptions: [{ id: 7, channelId: wanted.id }] }));
  }
}

client.on("message", (data, isBinary) => {
  if (!isBinary) {
    onText(JSON.parse(Buffer.from(data).toString()));
    return;
  }
  const view = new DataView(data);
  if (view.getUint8(0) !== 1) {
    return;
  }
  const message = reader.readMessage(new Uint8Array(data, 13));
  // Foxglove's reader calls the nanoseconds of a time nsec.
  const text = JSON.stringify(message, plain).replaceAll('"nsec":', '"nanosec":');
  const own = JSON.stringify(decodeCdr(ownTypes, new Uint8Array(data, 13)), plain);
  console.log(own === text ? "the page reads the same" : "the page reads " + own);
  console.log(`message ${view.getUint32(1, true)} ${view.getBigUint64(5, true)} ${text}`);
  if (--left === 0) {
    client.close();
  }
});
client.on("error", (error) => {
  console.log("error " + error.message);
  process.exit(1);
});
client.on("close", () => process.exit(left === 0 ? 0 : 1));
