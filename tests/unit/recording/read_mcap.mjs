// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// An MCAP file by the npm packages of Foxglove, for mcap_npm_test.cpp:
//   node read_mcap.mjs NODE_MODULES FILE [stream]
// Prints a line of JSON for the file (header, statistics, channels) and one for every message, in order of time by
// the index, or with "stream" in the order of the file, every record and CRC looked at. Messages are decoded by the
// definitions that the file itself brings.
import { createReadStream } from "node:fs";
import { open } from "node:fs/promises";
import { createRequire } from "node:module";

const [modules, file, how] = process.argv.slice(2);
const require = createRequire(`${modules}/`);
const { McapIndexedReader, McapStreamReader } = require("@mcap/core");
const { FileHandleReadable } = require("@mcap/nodejs");
const { parse } = require("@foxglove/rosmsg");
const { MessageReader } = require("@foxglove/rosmsg2-serialization");
const zstd = require("@foxglove/wasm-zstd");

await zstd.isLoaded;
const decompressHandlers = { zstd: (bytes, size) => zstd.decompress(bytes, Number(size)) };

/** 64-bit integers are text: they don't fit JSON's numbers. */
const print = (value) =>
  console.log(JSON.stringify(value, (key, each) => {
    if (typeof each === "bigint") {
      return String(each);
    }
    if (each instanceof Map) {
      return Object.fromEntries(each);
    }
    return ArrayBuffer.isView(each) ? Array.from(each) : each;
  }));

const readers = new Map();
function decoded(channel, schema, message) {
  if (!readers.has(channel.id)) {
    readers.set(channel.id, new MessageReader(parse(new TextDecoder().decode(schema.data), { ros2: true })));
  }
  return {
    topic: channel.topic,
    type: schema.name,
    logTime: message.logTime,
    publishTime: message.publishTime,
    sequence: message.sequence,
    value: readers.get(channel.id).readMessage(message.data),
  };
}

async function indexed() {
  const handle = await open(file, "r");
  const reader = await McapIndexedReader.Initialize({ readable: new FileHandleReadable(handle), decompressHandlers });
  const metadata = {};
  for await (const each of reader.readMetadata()) {
    metadata[each.name] = each.metadata;
  }
  print({
    header: reader.header,
    statistics: reader.statistics,
    chunks: reader.chunkIndexes.length,
    metadata,
    channels: [...reader.channelsById.values()].map((channel) => ({
      topic: channel.topic,
      messageEncoding: channel.messageEncoding,
      metadata: channel.metadata,
      schema: reader.schemasById.get(channel.schemaId).name,
      schemaEncoding: reader.schemasById.get(channel.schemaId).encoding,
    })),
  });
  for await (const message of reader.readMessages()) {
    const channel = reader.channelsById.get(message.channelId);
    print(decoded(channel, reader.schemasById.get(channel.schemaId), message));
  }
  await handle.close();
}

async function streamed() {
  const reader = new McapStreamReader({ decompressHandlers, includeChunks: true, validateCrcs: true });
  const [schemas, channels, kinds] = [new Map(), new Map(), {}];
  for await (const bytes of createReadStream(file)) {
    reader.append(bytes);
    for (let record = reader.nextRecord(); record !== undefined; record = reader.nextRecord()) {
      kinds[record.type] = (kinds[record.type] ?? 0) + 1;
      if (record.type === "Schema") {
        schemas.set(record.id, record);
      } else if (record.type === "Channel") {
        channels.set(record.id, record);
      } else if (record.type === "Message") {
        const channel = channels.get(record.channelId);
        print(decoded(channel, schemas.get(channel.schemaId), record));
      }
    }
  }
  print({ done: reader.done(), kinds });
}

await (how === "stream" ? streamed() : indexed());
