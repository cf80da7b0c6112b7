// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// MCAP files by the npm packages of Foxglove, for mcap_npm_test.cpp:
//   node write_mcap.mjs NODE_MODULES FOLDER
// Writes FOLDER/<kind>.mcap for every kind below, all with the messages of samples.hpp: 100 of the IMU, 10 fixes and
// clouds that arrive 50 ms late.
import { open } from "node:fs/promises";
import { createRequire } from "node:module";

const [modules, folder] = process.argv.slice(2);
const require = createRequire(`${modules}/`);
const { McapWriter } = require("@mcap/core");
const { FileHandleWritable } = require("@mcap/nodejs");
const { stringify } = require("@foxglove/rosmsg");
const ros1 = require("@foxglove/rosmsg-serialization");
const ros2 = require("@foxglove/rosmsg2-serialization");
const definitions = require("@foxglove/rosmsg-msgs-common");
const lz4 = require("lz4js");
const zstd = require("@foxglove/wasm-zstd");

await zstd.isLoaded;
const compress = {
  zstd: (bytes) => ({ compression: "zstd", compressedData: zstd.compress(bytes) }),
  lz4: (bytes) => ({ compression: "lz4", compressedData: lz4.compress(bytes) }),
};
const bare = { useStatistics: false, useSummaryOffsets: false, repeatSchemas: false, repeatChannels: false, useMessageIndex: false, useChunkIndex: false };
const kinds = {
  zstd: { compressChunk: compress.zstd, chunkSize: 5000 },
  lz4: { compressChunk: compress.lz4, chunkSize: 5000 },
  uncompressed: { chunkSize: 5000 },
  unchunked: { useChunks: false },
  zstd_without_summary: { compressChunk: compress.zstd, chunkSize: 5000, ...bare },
  lz4_without_summary: { compressChunk: compress.lz4, chunkSize: 5000, ...bare },
  unchunked_without_summary: { useChunks: false, ...bare },
  without_statistics: { compressChunk: compress.zstd, useStatistics: false },
  without_message_index: { compressChunk: compress.zstd, chunkSize: 5000, useMessageIndex: false },
  chunks_overlap: { compressChunk: compress.zstd, chunkSize: 5000, byTopic: true },
  unchunked_out_of_order: { useChunks: false, byTopic: true },
  idl: { compressChunk: compress.zstd, schemaEncoding: "ros2idl" },
  ros1: { compressChunk: compress.lz4, profile: "ros1" },
};

const start = 1316000000123456789n;
const millisecond = 1000000n;

function header(time, frame_id, profile) {
  const [sec, nsec] = [Number(time / 1000000000n), Number(time % 1000000000n)];
  return profile === "ros1" ? { seq: 0, stamp: { sec, nsec }, frame_id } : { stamp: { sec, nanosec: nsec }, frame_id };
}

function imu(index, profile) {
  const time = start + BigInt(index) * 10n * millisecond;
  const value = {
    header: header(time, "imu_link", profile),
    orientation: { w: 0.5, x: 0.5, y: -0.5, z: 0.5 },
    orientation_covariance: Array(9).fill(0),
    angular_velocity: { x: 0.1 + index, y: 0.2, z: 0.3 },
    angular_velocity_covariance: Array(9).fill(0),
    linear_acceleration: { x: 0.4, y: 0.5 + index * 1e-3, z: 9.81 },
    linear_acceleration_covariance: Array(9).fill(0),
  };
  return { topic: "/imu/data", type: "Imu", time, value };
}

function fix(index, profile) {
  const time = start + BigInt(index) * 100n * millisecond;
  const value = {
    header: header(time, "gnss_antenna", profile),
    status: { status: 2, service: 3 },
    latitude: 49.0 + index * 1e-6,
    longitude: 8.4,
    altitude: 116.25,
    position_covariance: [0.01, 0.002, 0.003, 0.002, 0.04, 0.005, 0.003, 0.005, 0.09],
    position_covariance_type: 3,
  };
  return { topic: "/gps/fix", type: "NavSatFix", time: time + 50n * millisecond, value };
}

function cloud(index, profile) {
  const time = start + BigInt(index) * 100n * millisecond;
  const value = {
    header: header(time, "lidar", profile),
    height: 1,
    width: 100,
    fields: ["x", "y", "z", "time"].map((name, i) => ({ name, offset: 4 * i, datatype: 7, count: 1 })),
    is_bigendian: false,
    point_step: 16,
    row_step: 1600,
    data: Uint8Array.from({ length: 1600 }, (_, i) => (i * 7 + index) & 255),
    is_dense: true,
  };
  return { topic: "/points", type: "PointCloud2", time: time + 50n * millisecond, value };
}

function drive(profile) {
  const messages = [];
  for (let i = 0; i < 100; ++i) {
    messages.push(imu(i, profile));
    if (i % 10 === 5) {
      messages.push(fix((i - 5) / 10, profile), cloud((i - 5) / 10, profile));
    }
  }
  return messages;
}

/** A type's definition with those of all the types in it, that type's first. */
function closure(all, type) {
  const found = [];
  const add = (name) => {
    const definition = all[name] ?? all[name.replace("/msg/", "/")];
    if (!found.includes(definition)) {
      found.push(definition);
      definition.definitions.filter((field) => field.isComplex).forEach((field) => add(field.type));
    }
  };
  add(type);
  return found;
}

async function write(kind, { profile = "ros2", schemaEncoding = `${profile}msg`, byTopic = false, ...options }) {
  const file = await open(`${folder}/${kind}.mcap`, "wx");
  const writer = new McapWriter({ writable: new FileHandleWritable(file), ...options });
  await writer.start({ profile, library: "npm" });
  const messages = drive(profile);
  if (byTopic) {
    messages.sort((a, b) => (a.topic < b.topic ? -1 : a.topic > b.topic ? 1 : 0));
  }
  await writer.addMetadata({ name: "not asked for", metadata: new Map([["key", "value"]]) });
  await writer.addAttachment({ name: "a.txt", logTime: start, createTime: 0n, mediaType: "text/plain", data: new Uint8Array(1000) });
  const channels = new Map();
  let sequence = 0;
  for (const message of messages) {
    const types = closure(definitions[profile === "ros1" ? "ros1" : "ros2humble"], `sensor_msgs/${message.type}`);
    if (!channels.has(message.topic)) {
      const name = profile === "ros1" ? `sensor_msgs/${message.type}` : `sensor_msgs/msg/${message.type}`;
      const data = new TextEncoder().encode(schemaEncoding === "ros2idl" ? "" : stringify(types));
      const schemaId = await writer.registerSchema({ name, encoding: schemaEncoding, data });
      const messageEncoding = profile === "ros1" ? "ros1" : "cdr";
      const id = await writer.registerChannel({ schemaId, topic: message.topic, messageEncoding, metadata: new Map() });
      const serialiser = profile === "ros1" ? new ros1.MessageWriter(types) : new ros2.MessageWriter(types);
      channels.set(message.topic, { id, serialiser });
    }
    const { id, serialiser } = channels.get(message.topic);
    const data = serialiser.writeMessage(message.value);
    await writer.addMessage({ channelId: id, sequence: sequence++, logTime: message.time, publishTime: message.time, data });
  }
  await writer.end();
  await file.close();
}

for (const [kind, options] of Object.entries(kinds)) {
  await write(kind, options);
}
