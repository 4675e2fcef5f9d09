// SPDX-License-Identifier: Apache-2.0
// The bar of colours beside the image, with the values that they stand for.

import { cssColor } from "./colors.js";
import { prepared, ticks } from "./strips.js";

export function drawColorBar(canvas: HTMLCanvasElement, colors: Uint8Array, low: number, high: number): void {
  const context = prepared(canvas);
  if (context === null) return;
  const height = canvas.clientHeight;
  context.clearRect(0, 0, canvas.clientWidth, height);
  const top = 8;
  const bottom = height - 8;
  for (let y = top; y < bottom; ++y) {
    const entry = Math.round(((bottom - 1 - y) / (bottom - 1 - top)) * 255);
    context.fillStyle = cssColor(colors, entry);
    context.fillRect(0, y, 14, 1);
  }
  context.font = '11px "DejaVu Sans", sans-serif';
  context.fillStyle = "#8fa1b3";
  const marks = ticks(low, high, Math.max(2, Math.floor(height / 60)));
  const step = marks.length > 1 ? marks[1] - marks[0] : 1;
  const decimals = Math.min(6, Math.max(0, Math.ceil(-Math.log10(step) - 1e-9)));
  for (const mark of marks) {
    const y = bottom - ((mark - low) / (high - low)) * (bottom - top);
    context.fillRect(14, Math.round(y), 4, 1);
    context.fillText(mark.toFixed(decimals), 21, y + 4);
  }
}
