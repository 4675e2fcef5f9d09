// SPDX-License-Identifier: Apache-2.0
// Probes: pixels whose values are kept over time.

import { Point } from "./image.js";
import { PROBE_COLORS } from "./colors.js";
import { Series } from "./strips.js";

export const MAX_PROBES = PROBE_COLORS.length;
/** Values kept of each probe: two minutes at ten a second. */
const KEPT = 1200;

export class Probes {
  readonly places: (Point | null)[] = new Array<Point | null>(MAX_PROBES).fill(null);
  readonly radiance = PROBE_COLORS.map((color) => new Series(color, KEPT));
  readonly shown = PROBE_COLORS.map((color) => new Series(color, KEPT));

  /** Puts a probe on a pixel. Returns its index; -1: there are enough. */
  put(point: Point): number {
    const free = this.places.indexOf(null);
    if (free >= 0) this.move(free, point);
    return free;
  }

  move(index: number, point: Point): void {
    this.places[index] = point;
    this.radiance[index].clear();
    this.shown[index].clear();
  }

  /** Takes away the probe within some pixels of a place. Returns its index; -1: there is none. */
  takeAwayAt(point: Point, reachPx: number): number {
    let best = -1;
    let nearest = reachPx;
    this.places.forEach((place, i) => {
      if (place === null) return;
      const distance = Math.hypot(place.x - point.x, place.y - point.y);
      if (distance <= nearest) {
        nearest = distance;
        best = i;
      }
    });
    if (best >= 0) this.takeAway(best);
    return best;
  }

  takeAway(index: number): void {
    this.places[index] = null;
    this.radiance[index].clear();
    this.shown[index].clear();
  }

  /** Returns the index of the last probe; -1: there is none. */
  last(): number {
    let found = -1;
    this.places.forEach((place, i) => {
      if (place !== null) found = i;
    });
    return found;
  }

  /** Keeps the values of a new frame. */
  sample(time: number, value: (point: Point) => number, convert: (radiance: number) => number): void {
    this.places.forEach((place, i) => {
      if (place === null) return;
      const radiance = value(place);
      this.radiance[i].add(time, radiance);
      this.shown[i].add(time, convert(radiance));
    });
  }

  /** Converts what is kept, after another quantity was chosen. */
  convertAll(convert: (radiance: number) => number): void {
    this.shown.forEach((series, i) => {
      series.clear();
      this.radiance[i].each(-Infinity, (time, radiance) => series.add(time, convert(radiance)));
    });
  }

  clearHistory(): void {
    for (const series of [...this.radiance, ...this.shown]) series.clear();
  }
}
