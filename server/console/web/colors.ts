// SPDX-License-Identifier: Apache-2.0
// Colours: the maps come from emitd, so that they are those of its other displays.

/** Returns 256 colours, RGBA, of "rrggbb" 256 times. */
export function colorTable(hex: string): Uint8Array {
  const out = new Uint8Array(256 * 4);
  for (let i = 0; i < 256; ++i) {
    for (let k = 0; k < 3; ++k) {
      out[4 * i + k] = parseInt(hex.substr(6 * i + 2 * k, 2), 16);
    }
    out[4 * i + 3] = 255;
  }
  return out;
}

/** Returns the colours from the last to the first. */
export function reversed(table: Uint8Array): Uint8Array {
  const out = new Uint8Array(table.length);
  for (let i = 0; i < 256; ++i) out.set(table.subarray(4 * i, 4 * i + 4), 4 * (255 - i));
  return out;
}

export function cssColor(table: Uint8Array, entry: number): string {
  return `rgb(${table[4 * entry]},${table[4 * entry + 1]},${table[4 * entry + 2]})`;
}

/** Colours of probes: they differ in lightness too, and none of them is red, which means a fault. */
export const PROBE_COLORS = [
  "#6fd3ff", "#ffd166", "#9bef8b", "#d5a6ff", "#ffa6c9", "#7ff0d8", "#f2b880", "#c8d6e5",
];
