// SPDX-License-Identifier: Apache-2.0
// Apparent temperature by the table of emitd (physics::TemperatureTable), step by step the same.

export class TemperatureTable {
  constructor(
    private readonly radiance: Float64Array,
    private readonly fromK: number,
    private readonly stepK: number,
  ) {}

  /** Returns the temperature in K of a blackbody of this in-band radiance. */
  kelvin(radiance: number): number {
    if (Number.isNaN(radiance)) return NaN;
    const i = this.interval(radiance);
    const low = this.radiance[i];
    const fraction = (radiance - low) / (this.radiance[i + 1] - low);
    return this.fromK + this.stepK * (i + Math.min(Math.max(fraction, 0), 1));
  }

  /** Returns the in-band radiance of a blackbody of this temperature. */
  radianceAt(kelvin: number): number {
    const last = this.radiance.length - 1;
    const place = Math.min(Math.max((kelvin - this.fromK) / this.stepK, 0), last);
    const i = Math.min(Math.floor(place), last - 1);
    return this.radiance[i] + (place - i) * (this.radiance[i + 1] - this.radiance[i]);
  }

  private interval(radiance: number): number {
    let low = 0;
    let high = this.radiance.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.radiance[middle] <= radiance) low = middle + 1;
      else high = middle;
    }
    return Math.min(Math.max(low, 1), this.radiance.length - 1) - 1;
  }
}

/** Fetches the table of a channel. */
export async function fetchTable(channel: number, fromK: number, stepK: number): Promise<TemperatureTable> {
  const answer = await fetch(`/temperatures?channel=${channel}`);
  if (!answer.ok) throw new Error(`temperatures of channel ${channel}: ${answer.status}`);
  return new TemperatureTable(new Float64Array(await answer.arrayBuffer()), fromK, stepK);
}
