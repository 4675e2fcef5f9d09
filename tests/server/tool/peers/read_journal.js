// SPDX-License-Identifier: Apache-2.0
// Reads a log of emitd by its index with the MCAP library of its authors, decodes the messages with the
// schemas in the file, and prints what it saw as JSON.
// Usage: NODE_PATH=FOLDER/node_modules node read_journal.js LOG
"use strict";
const fs = require("fs");
const { McapIndexedReader } = require("@mcap/core");
const { protobufFromBinaryDescriptor } = require("@mcap/support");

/// Random access to a file, as the reader wants it.
class FileReadable {
  constructor(path) {
    this.file = fs.openSync(path, "r");
    this.bytesRead = 0;
  }
  async size() {
    return BigInt(fs.fstatSync(this.file).size);
  }
  async read(offset, size) {
    const bytes = new Uint8Array(Number(size));
    fs.readSync(this.file, bytes, 0, bytes.length, Number(offset));
    this.bytesRead += bytes.length;
    return bytes;
  }
}

async function main(path) {
  const readable = new FileReadable(path);
  const reader = await McapIndexedReader.Initialize({ readable });
  const types = new Map();
  const decode = (message) => {
    const channel = reader.channelsById.get(message.channelId);
    if (!types.has(channel.id)) {
      const schema = reader.schemasById.get(channel.schemaId);
      const root = protobufFromBinaryDescriptor(schema.data);
      types.set(channel.id, root.lookupType(schema.name));
    }
    const type = types.get(channel.id);
    return type.toObject(type.decode(message.data), { longs: String, enums: String });
  };
  const seen = {
    library: reader.header.library,
    chunks: reader.chunkIndexes.length,
    messages: String(reader.statistics.messageCount),
    topics: [...reader.channelsById.values()].map((channel) => channel.topic).sort(),
    read: 0,
    frames: [],
    crcs: [],
  };
  let first;
  let last;
  for await (const message of reader.readMessages({ topics: ["journal"] })) {
    const entry = decode(message);
    ++seen.read;
    if (entry.run_start && !seen.run) {
      const setup = entry.run_start.recording;
      seen.run = entry.run_start.run_id;
      seen.device = entry.run_start.device;
      seen.values = Object.fromEntries(
        [...(setup.scenario ?? []), ...(setup.daemon ?? [])].map((one) => [
          one.key,
          one.value,
        ]),
      );
      seen.channels = (setup.channels ?? []).map((channel) => channel.name);
    }
    if (entry.frame) {
      seen.frames.push(Number(entry.frame.frame_number));
      seen.crcs.push(entry.frame.radiance_crc32c);
      first = first ?? message.logTime;
      last = message.logTime;
    }
  }
  // The last tenth by log time alone: the index tells where it is.
  const late = last - (last - first) / 10n;
  seen.late_frames = [];
  readable.bytesRead = 0;
  for await (const message of reader.readMessages({ topics: ["journal"], startTime: late })) {
    const entry = decode(message);
    if (entry.frame) seen.late_frames.push(Number(entry.frame.frame_number));
  }
  seen.late_bytes = readable.bytesRead;
  console.log(JSON.stringify(seen, null, 1));
}

main(process.argv[2]).catch((error) => {
  console.error(error);
  process.exit(1);
});
