// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Prints what the npm package `copc` reads of a LAS file, which knows nothing of how we write it.
//   node read_las.mjs NODE_MODULES FILE.las
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";

const [modules, file] = process.argv.slice(2);
const { Las } = createRequire(`${modules}/`)("copc");
const bytes = readFileSync(file);
const get = async (begin, end) => bytes.subarray(begin, end);

const header = Las.Header.parse(bytes.subarray(0, Las.Constants.minHeaderLength));
const records = await Las.Vlr.walk(get, header);
const wkt = await Las.Vlr.fetch(get, Las.Vlr.find(records, "LASF_Projection", 2112));
const points = bytes.subarray(header.pointDataOffset);
const view = Las.View.create(points, header);
const dimension = (name) => view.getter(name);
const [x, y, z] = ["X", "Y", "Z"].map(dimension);
console.log(`version ${header.majorVersion}.${header.minorVersion}`);
console.log(`points ${header.pointCount}`);
console.log(`wkt ${wkt.toString("utf8").replace(/\0$/, "")}`);
for (let i = 0; i < header.pointCount; ++i) {
  console.log(`point ${x(i).toFixed(3)} ${y(i).toFixed(3)} ${z(i).toFixed(3)} ${dimension("Intensity")(i)}`);
}
