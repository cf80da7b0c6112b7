// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Reads CDR (XCDR1, either byte order) by a "ros2msg" schema, as the server advertises it.
"use strict";

const kRule = "=".repeat(80);
const kSizes = { bool: 1, int8: 1, uint8: 1, int16: 2, uint16: 2, int32: 4, uint32: 4, int64: 8, uint64: 8, float32: 4, float64: 8 };
const kGetters = {
  bool: (v, at) => v.getUint8(at) !== 0,
  int8: (v, at) => v.getInt8(at),
  uint8: (v, at) => v.getUint8(at),
  int16: (v, at, little) => v.getInt16(at, little),
  uint16: (v, at, little) => v.getUint16(at, little),
  int32: (v, at, little) => v.getInt32(at, little),
  uint32: (v, at, little) => v.getUint32(at, little),
  int64: (v, at, little) => Number(v.getBigInt64(at, little)),
  uint64: (v, at, little) => Number(v.getBigUint64(at, little)),
  float32: (v, at, little) => v.getFloat32(at, little),
  float64: (v, at, little) => v.getFloat64(at, little),
};

// Map of type name to fields [{type, name, count}]; the root's name is "". count: null one value,
// -1 a sequence, else an array's length.
function parseSchema(text) {
  const types = new Map();
  for (const part of text.split(kRule)) {
    const lines = part.split("\n").map((line) => line.trim()).filter((line) => line);
    const named = lines.length && lines[0].startsWith("MSG: ");
    const fields = (named ? lines.slice(1) : lines).map((line) => {
      const [, type, array, name] = line.match(/^([\w/]+)(\[\d*\])?\s+(\w+)$/);
      return { type, name, count: array === undefined ? null : array === "[]" ? -1 : Number(array.slice(1, -1)) };
    });
    types.set(named ? lines[0].slice(5) : "", fields);
  }
  return types;
}

class CdrReader {
  constructor(types, bytes) {
    this.types = types;
    this.view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    this.little = (this.view.getUint8(1) & 1) === 1;
    this.at = 4; // alignment counts from here, behind the encapsulation header
  }

  primitive(type) {
    const size = kSizes[type];
    this.at = 4 + Math.ceil((this.at - 4) / size) * size;
    const value = kGetters[type](this.view, this.at, this.little);
    this.at += size;
    return value;
  }

  bytes(length) {
    const part = new Uint8Array(this.view.buffer, this.view.byteOffset + this.at, length);
    this.at += length;
    return part;
  }

  value(type) {
    if (type === "string") {
      const length = this.primitive("uint32");
      return new TextDecoder().decode(this.bytes(length)).replace(/\0$/, "");
    }
    return type in kSizes ? this.primitive(type) : this.struct(type);
  }

  field(field) {
    if (field.count === null) {
      return this.value(field.type);
    }
    const count = field.count < 0 ? this.primitive("uint32") : field.count;
    if (field.type === "uint8") {
      return this.bytes(count);
    }
    if (count > this.view.byteLength) {
      throw new RangeError("a sequence longer than its message");
    }
    return Array.from({ length: count }, () => this.value(field.type));
  }

  struct(type) {
    const result = {};
    for (const field of this.types.get(type)) {
      result[field.name] = this.field(field);
    }
    return result;
  }
}

const decodeCdr = (types, bytes) => new CdrReader(types, bytes).struct("");

if (typeof module !== "undefined") {
  module.exports = { parseSchema, decodeCdr };
}
