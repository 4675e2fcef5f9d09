// SPDX-License-Identifier: Apache-2.0
// Reads an MCAP file of Foxglove's messages by its index with the MCAP library of its authors, decodes
// the messages with the schemas in the file, and prints one line for each, in the order of log time:
// topic, schema, log time, publish time, time stamp, then the fields. Numbers are as JavaScript has them.
// Usage: NODE_PATH=FOLDER/node_modules node read_foxglove.js FILE
"use strict";
const fs = require("fs");
const { McapIndexedReader } = require("@mcap/core");
const { protobufFromBinaryDescriptor } = require("@mcap/support");

/// Random access to a file, as the reader wants it.
class FileReadable {
  constructor(path) {
    this.file = fs.openSync(path, "r");
  }
  async size() {
    return BigInt(fs.fstatSync(this.file).size);
  }
  async read(offset, size) {
    const bytes = new Uint8Array(Number(size));
    fs.readSync(this.file, bytes, 0, bytes.length, Number(offset));
    return bytes;
  }
}

const xyz = (v) => [v.x, v.y, v.z];
const xyzw = (q) => [q.x, q.y, q.z, q.w];

/// Fields of a message by the name of its schema.
const fields = {
  "foxglove.PoseInFrame": (m) => [
    m.frame_id,
    ...xyz(m.pose.position),
    ...xyzw(m.pose.orientation),
  ],
  "foxglove.FrameTransform": (m) => [
    m.parent_frame_id,
    m.child_frame_id,
    ...xyz(m.translation),
    ...xyzw(m.rotation),
  ],
  "foxglove.LocationFix": (m) => [m.frame_id, m.latitude, m.longitude, m.altitude],
  "foxglove.RawImage": (m) => [
    m.frame_id,
    m.width,
    m.height,
    m.encoding,
    m.step,
    Buffer.from(m.data).toString("hex"),
  ],
  "foxglove.CameraCalibration": (m) => [m.frame_id, m.width, m.height, ...m.K, ...m.R, ...m.P],
  "foxglove.Log": (m) => [m.level, m.name, m.message],
  "emit.v1.FrameDecision": (m) => [m.frame_number, m.sim_time_ns, m.radiance_crc32c],
};

async function main(path) {
  const reader = await McapIndexedReader.Initialize({ readable: new FileReadable(path) });
  const types = new Map();
  for await (const message of reader.readMessages()) {
    const channel = reader.channelsById.get(message.channelId);
    const schema = reader.schemasById.get(channel.schemaId);
    if (!types.has(schema.id)) {
      if (schema.encoding !== "protobuf" || channel.messageEncoding !== "protobuf") {
        throw new Error(`${channel.topic}: ${schema.encoding}, ${channel.messageEncoding}`);
      }
      types.set(schema.id, protobufFromBinaryDescriptor(schema.data).lookupType(schema.name));
    }
    const type = types.get(schema.id);
    const value = type.toObject(type.decode(message.data), {
      defaults: true,
      enums: String,
      longs: String,
    });
    const stamp = value.timestamp
      ? BigInt(value.timestamp.seconds) * 1000000000n + BigInt(value.timestamp.nanos)
      : message.logTime;
    console.log(
      [
        channel.topic,
        schema.name,
        message.logTime,
        message.publishTime,
        stamp,
        ...fields[schema.name](value),
      ].join("\t"),
    );
  }
}

main(process.argv[2]).catch((error) => {
  console.error(error);
  process.exit(1);
});
