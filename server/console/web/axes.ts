// SPDX-License-Identifier: Apache-2.0
// The axes of the motion simulator: angles demanded and measured, and the error, over time.

import { PROBE_COLORS } from "./colors.js";
import { element, fillTable, ms } from "./display.js";
import { Axes } from "./link.js";
import { Series, Strip } from "./strips.js";

const SECONDS = 20;
const CAPACITY = 2048;
const NAMES = ["unit 1", "unit 2", "unit 3", "target azimuth", "target elevation"];
const DEMAND_COLOR = "#e6b450";
const MEASURED_COLOR = "#6fd3ff";
const MOTION_STATES = ["none", "waiting", "parked", "parking", "capturing", "following", "fault"];
const MOTION_FAULTS = [
  "no measurements", "no poses", "interlock open", "axis at a limit", "axes nearly parallel", "simulation clock jumped",
  "clocks differ", "commands not followed",
];

/** What one axis did. Angles in degrees, errors in thousandths of a degree. */
class Axis {
  readonly demand = new Series(DEMAND_COLOR, CAPACITY);
  readonly measured = new Series(MEASURED_COLOR, CAPACITY);
  readonly error: Series;
  readonly angles: Strip;

  constructor(color: string, canvas: HTMLCanvasElement) {
    this.error = new Series(color, CAPACITY);
    this.angles = new Strip(canvas, [this.demand, this.measured], {
      seconds: SECONDS, fromZero: false, unit: "\u00b0", dots: false,
    });
  }
}

export class AxesPanel {
  /** The axis whose angles are drawn. */
  chosen = 0;
  readonly axes: Axis[] = [];
  private errors: Strip | null = null;

  constructor() {
    element<HTMLTableElement>("axes").tBodies[0].onclick = (event) => {
      const row = (event.target as HTMLElement).closest("tr");
      if (row !== null) this.choose(row.sectionRowIndex);
    };
  }

  show(there: boolean): void {
    element("axes-panel").hidden = !there;
  }

  /** Chooses the next axis, and begins again after the last. */
  next(): void {
    if (this.axes.length > 0) this.choose((this.chosen + 1) % this.axes.length);
  }

  take(axes: Axes): void {
    const count = axes.measured_deg.length;
    if (count !== this.axes.length) this.make(count);
    const now = performance.now() / 1000;
    for (const [ageMs, measured, demanded] of axes.ticks) {
      this.axes.forEach((axis, i) => {
        const time = now - ageMs / 1000;
        const asked = demanded.length > i ? demanded[i] : NaN;
        axis.demand.add(time, asked);
        axis.measured.add(time, measured[i]);
        axis.error.add(time, 1000 * (measured[i] - asked));
      });
    }
    const faults = MOTION_FAULTS.filter((_, bit) => (axes.faults & (1 << bit)) !== 0);
    const age = axes.age_us === null ? "no measurement" : `measured ${ms(axes.age_us)} ms ago`;
    element("axes-state").textContent =
      `${MOTION_STATES[axes.state] ?? "?"}, ${age}${faults.length > 0 ? `: ${faults.join(", ")}` : ""}`;
    element("axes-state").className = faults.length > 0 ? "bad" : "";
    const number = (value: number, digits: number) => (Number.isFinite(value) ? value.toFixed(digits) : "\u2013");
    fillTable(
      element<HTMLTableElement>("axes"),
      this.axes.map((axis, i) => [
        NAMES[i] ?? String(i + 1),
        number(axis.demand.last, 4),
        number(axis.measured.last, 4),
        number(axis.error.last, 2),
      ]),
    );
    this.draw(now);
  }

  private make(count: number): void {
    this.axes.length = 0;
    for (let i = 0; i < count; ++i) this.axes.push(new Axis(PROBE_COLORS[i], element("axes-strip")));
    this.errors = new Strip(element("axes-error-strip"), this.axes.map((axis) => axis.error), {
      seconds: SECONDS, fromZero: false, unit: "m\u00b0", dots: false,
    });
    this.choose(Math.min(this.chosen, Math.max(count - 1, 0)));
  }

  private choose(axis: number): void {
    this.chosen = axis;
    this.draw(performance.now() / 1000);
  }

  private draw(now: number): void {
    const rows = element<HTMLTableElement>("axes").tBodies[0].rows;
    for (let i = 0; i < rows.length; ++i) {
      rows[i].className = i === this.chosen ? "on" : "";
      rows[i].cells[0].style.color = PROBE_COLORS[i];
    }
    element("axes-name").textContent = NAMES[this.chosen] ?? "";
    this.axes[this.chosen]?.angles.draw(now);
    this.errors?.draw(now);
  }
}
