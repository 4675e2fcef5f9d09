// SPDX-License-Identifier: Apache-2.0
// Encodes Entity State PDUs by the npm package open-dis: encode_dis.js NODE_MODULES VERSION. It reads states as lines
// of JSON from standard input and writes each PDU as a line of hexadecimal digits.
"use strict";
const path = require("path");
const [modules, version] = process.argv.slice(2);
const openDis = require(path.join(modules, "open-dis", "dist", `dis${version}.min.js`));

const lines = require("fs").readFileSync(0, "utf8").split("\n").filter(line => line !== "");
for (const line of lines) {
  const state = JSON.parse(line);
  const pdu = new openDis.EntityStatePdu();
  pdu.protocolVersion = Number(version);
  pdu.exerciseID = state.exercise;
  pdu.timestamp = state.timestamp;
  // The package leaves the length to its caller. Its two versions have some names of their own.
  pdu.pduLength = pdu.length = 144;
  const [site, application, entity] = state.id;
  Object.assign(pdu.entityID, version === "6" ? { site, application, entity }
    : { siteID: site, applicationID: application, entityID: entity });
  Object.assign(pdu.entityLocation, state.location);
  Object.assign(pdu.entityLinearVelocity, state.velocity);
  Object.assign(pdu.entityOrientation, state.orientation);
  pdu.deadReckoningParameters.deadReckoningAlgorithm = 2;
  const stream = new openDis.OutputStream(new ArrayBuffer(256));
  pdu.encodeToBinary(stream);
  console.log(Buffer.from(stream.toByteArray()).toString("hex"));
}
