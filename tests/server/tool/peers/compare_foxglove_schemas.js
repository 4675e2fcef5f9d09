// SPDX-License-Identifier: Apache-2.0
// Compares the Protobuf schemas in an MCAP file with those that Foxglove publishes as a package: names,
// numbers and types of all fields, values of all enumerations, also of messages within messages.
// Usage: NODE_PATH=FOLDER/node_modules node compare_foxglove_schemas.js FILE
"use strict";
const fs = require("fs");
const protobuf = require("protobufjs");
const { McapStreamReader } = require("@mcap/core");
const { protobufFromBinaryDescriptor } = require("@mcap/support");
const published = require("@foxglove/schemas/internal");

/// Returns what is published about a message, parsed from the text that the package makes.
function publishedType(name) {
  const schema = published.foxgloveMessageSchemas[name];
  if (schema === undefined) throw new Error(`${name}: Foxglove publishes no such message`);
  const enums = Object.values(published.foxgloveEnumSchemas).filter(
    (one) => one.parentSchemaName === name,
  );
  const text = published.generateProto(schema, enums);
  return protobuf.parse(text, { keepCase: true }).root.lookupType(`foxglove.${name}`);
}

/// A type within a message is named in full by the one and in short by the other.
const short = (type) => type.slice(type.lastIndexOf(".") + 1);
/// A descriptor says "optional" by an enclosing oneof of one field.
const label = (field) => {
  if (field.repeated) return "repeated";
  const alone = field.partOf?.name === `_${field.name}`;
  return alone || field.options?.proto3_optional ? "optional" : "single";
};
const lines = (type) => [
  ...type.fieldsArray.map((f) => `${f.id} ${label(f)} ${short(f.type)} ${f.name}`).sort(),
  ...type.nestedArray
    .filter((one) => one instanceof protobuf.Enum)
    .map((one) => `enum ${one.name} ${JSON.stringify(one.values)}`),
];

let compared = 0;
let fieldCount = 0;
const seen = new Set();
function compare(root, name) {
  if (seen.has(name)) return;
  seen.add(name);
  const ours = root.lookupType(`foxglove.${name}`);
  const theirs = publishedType(name);
  const [a, b] = [lines(ours).join("\n"), lines(theirs).join("\n")];
  if (a !== b) throw new Error(`foxglove.${name} differs:\n${a}\npublished:\n${b}`);
  compared += 1;
  fieldCount += ours.fieldsArray.length;
  for (const field of ours.fieldsArray) {
    const inner = short(field.type);
    if (field.type.includes("google.protobuf.")) continue;
    if (published.foxgloveMessageSchemas[inner] !== undefined) compare(root, inner);
  }
}

const reader = new McapStreamReader();
reader.append(fs.readFileSync(process.argv[2]));
for (let record; (record = reader.nextRecord()); ) {
  if (record.type !== "Schema" || !record.name.startsWith("foxglove.")) continue;
  compare(protobufFromBinaryDescriptor(record.data), record.name.slice("foxglove.".length));
}
console.log(JSON.stringify({ messages: compared, fields: fieldCount }));
