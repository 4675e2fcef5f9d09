// SPDX-License-Identifier: Apache-2.0
// How emitd keeps time: frame time and latency of every frame.

import { element } from "./display.js";
import { Status } from "./link.js";
import { Series, Strip } from "./strips.js";

const FRAME_SECONDS = 10;
const CAPACITY = 4096;

export class PacePanel {
  private readonly frameTimes = new Series("#6fd3ff", CAPACITY);
  private readonly latencies = new Series("#9bef8b", CAPACITY);
  private readonly frameStrip = new Strip(element("frame-strip"), [this.frameTimes], {
    seconds: FRAME_SECONDS, fromZero: true, unit: "ms", dots: true,
  });
  private readonly latencyStrip = new Strip(element("latency-strip"), [this.latencies], {
    seconds: FRAME_SECONDS, fromZero: true, unit: "ms", dots: true,
  });

  /** Forgets the frames of an earlier run. */
  clear(): void {
    this.frameTimes.clear();
    this.latencies.clear();
  }

  take(status: Status): void {
    const now = performance.now() / 1000;
    let late = 0;
    for (const tick of status.ticks) {
      const [, flags, ageMs, frameUs, frameDeadlineUs, latencyUs, latencyDeadlineUs] = tick;
      const time = now - ageMs / 1000;
      if (frameUs !== null && (flags & 2) === 0) this.frameTimes.add(time, frameUs / 1000);
      if (latencyUs !== null) this.latencies.add(time, latencyUs / 1000);
      if (frameDeadlineUs !== null) this.frameStrip.deadline = frameDeadlineUs / 1000;
      if (latencyDeadlineUs !== null) this.latencyStrip.deadline = latencyDeadlineUs / 1000;
      if ((flags & 1) !== 0) ++late;
    }
    if (late > 0) element("late").classList.add("flash");
    else element("late").classList.remove("flash");
    const lateCount = status.counters["frames_late"] ?? 0;
    const repeated = status.counters["frames_repeated"] ?? 0;
    element("late").textContent = `${lateCount} late, ${repeated} repeated`;
    element("frame-value").textContent = `${this.frameTimes.last.toFixed(2)} ms`;
    element("latency-value").textContent = Number.isNaN(this.latencies.last) ? "" : `${this.latencies.last.toFixed(2)} ms`;
    this.frameStrip.draw(now);
    this.latencyStrip.draw(now);
  }
}
