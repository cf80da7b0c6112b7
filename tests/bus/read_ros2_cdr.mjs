// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// ROS 2 messages by the npm packages of Foxglove, for ros2_cdr_test.cpp:
//   node read_ros2_cdr.mjs NODE_MODULES DISTRO FOLDER
// For each N.json in FOLDER, {"type": "sensor_msgs/Imu", "cdr": hexadecimal digits, "value": {...}}: compares the
// bytes, as read by the definitions of DISTRO (ros2humble, ros2jazzy, ...), with the value, prints every field that
// differs, and writes N.out with the value written anew ("again") and with a message of its own ("other", "value").
// Exit code 1 when a field differs.
import { readdirSync, readFileSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";

const [modules, distro, folder] = process.argv.slice(2);
const require = createRequire(`${modules}/`);
const { parse } = require("@foxglove/rosmsg");
const { MessageReader, MessageWriter } = require("@foxglove/rosmsg2-serialization");
const definitions = require("@foxglove/rosmsg-msgs-common")[distro];

/** A type's definition with those of all the types in it, that type's first. */
function closure(type) {
  const found = [];
  const add = (name) => {
    const definition = definitions[name] ?? definitions[name.replace("/msg/", "/")];
    if (definition === undefined) {
      throw new Error(`no definition of ${name} in ${distro}`);
    }
    if (!found.includes(definition)) {
      found.push(definition);
      definition.definitions.filter((field) => field.isComplex).forEach((field) => add(field.type));
    }
  };
  add(type);
  return found;
}

/** As JSON has it: typed arrays are arrays, and numbers that are not finite are text. */
function plain(value) {
  if (ArrayBuffer.isView(value)) {
    return Array.from(value, plain);
  }
  if (Array.isArray(value)) {
    return value.map(plain);
  }
  if (typeof value === "number" && !Number.isFinite(value)) {
    return String(value);
  }
  if (typeof value === "bigint") {
    return Number(value);
  }
  return typeof value === "object" ? Object.fromEntries(Object.entries(value).map(([k, v]) => [k, plain(v)])) : value;
}

function unplain(value) {
  if (Array.isArray(value)) {
    return value.map(unplain);
  }
  if (value === "NaN") {
    return NaN;
  }
  return typeof value === "object" ? Object.fromEntries(Object.entries(value).map(([k, v]) => [k, unplain(v)])) : value;
}

function differences(read, expected, path) {
  if (typeof read !== "object" || typeof expected !== "object") {
    return Object.is(read, expected) ? [] : [`${path}: ${JSON.stringify(read)} read, ${JSON.stringify(expected)} written`];
  }
  const keys = new Set([...Object.keys(read), ...Object.keys(expected)]);
  return [...keys].flatMap((key) => differences(read[key], expected[key], `${path}.${key}`));
}

/** A message in which every number and text is another, from the definitions alone. */
function invent(types, root) {
  let count = 0;
  const scalar = (type) => {
    count += 1;
    switch (type) {
      case "string": return "text".slice(0, count % 5) + count;
      case "bool": return count % 2 === 1;
      case "float32": case "float64": return -count - 0.125;
      case "int8": case "int16": case "int32": return -(count % 128);
      default: return count % 256;
    }
  };
  const one = (field) => {
    if (field.type === "time" || field.type === "duration") {
      return { sec: -scalar("uint8"), nanosec: scalar("uint8") };
    }
    return field.isComplex ? message(field.type) : scalar(field.type);
  };
  const message = (name) => {
    const short = name.replace("/msg/", "/");
    const type = name === root ? types[0] : types.find((each) => each.name?.replace("/msg/", "/") === short);
    const fields = type.definitions.filter((field) => field.isConstant !== true);
    return Object.fromEntries(fields.map((field) => [
      field.name,
      field.isArray === true ? Array.from({ length: field.arrayLength ?? 3 }, () => one(field)) : one(field),
    ]));
  };
  return message(root);
}

let wrong = 0;
for (const name of readdirSync(folder).filter((each) => each.endsWith(".json"))) {
  const { type, cdr, value } = JSON.parse(readFileSync(`${folder}/${name}`, "utf8"));
  const types = closure(type);
  const read = plain(new MessageReader(types).readMessage(Buffer.from(cdr, "hex")));
  const found = differences(read, value, `${name} ${type}`);
  found.forEach((line) => console.log(line));
  wrong += found.length;
  const writer = new MessageWriter(types);
  const other = invent(types, type);
  const written = (each) => Buffer.from(writer.writeMessage(each)).toString("hex");
  writeFileSync(
    `${folder}/${name.replace(".json", ".out")}`,
    JSON.stringify({ again: written(unplain(value)), other: written(other), value: other }),
  );
}
process.exit(wrong === 0 ? 0 : 1);
