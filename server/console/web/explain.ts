// SPDX-License-Identifier: Apache-2.0
// How the surface under a probe came to its temperature: what emitd has worked out beside the run.

import { PROBE_COLORS } from "./colors.js";
import { element } from "./display.js";
import { Point } from "./image.js";
import { Channel, Frame, Link } from "./link.js";
import { prepared, ticks } from "./strips.js";

const SURFACE = "#6fd3ff";
const EQUILIBRIUM = "#e6b450";
const TEXT = "#8fa1b3";
const GRID = "#1c252f";
const FONT = '11px "DejaVu Sans", sans-serif';
/** Least direct sun on a face that counts as lit, W/m2. */
const LIT_W_M2 = 1;
/** Terms of a radiance, in the order of `emit explain`. */
const TERMS: [string, string][] = [
  ["emission_w_m2_sr", "emission"], ["sky_w_m2_sr", "reflected sky"], ["neighbours_w_m2_sr", "reflected neighbours"],
  ["sun_w_m2_sr", "reflected sun"], ["lobe_sky_w_m2_sr", "sky in the lobe"],
  ["lobe_neighbours_w_m2_sr", "neighbours in the lobe"], ["glint_w_m2_sr", "glint"], ["path_w_m2_sr", "path"],
  ["scattered_w_m2_sr", "scattered sun"], ["bodies_w_m2_sr", "sun and moon"], ["gas_w_m2_sr", "gas"],
];

interface Row {
  sim_time_s: number;
  temperature_k: number | null;
  equilibrium_k: number | null;
  sun_w_m2: number | null;
  sun_frac: number | null;
}

interface Band {
  band: string;
  pixel_w_m2_sr: number;
  sum_w_m2_sr: number;
  apparent_k: number;
  emissivity_frac: number;
  air_frac: number;
  terms: Record<string, number>;
}

/** What `emit explain --json` writes. */
interface Result {
  utc: string;
  sim_time_s: number;
  surface: {
    object: string; is_entity: boolean; material: string; range_m: number; temperature_k: number; sky_frac: number;
  } | null;
  bands: Band[];
  history: Row[];
}

export interface Explanation {
  channel: number;
  x: number;
  y: number;
  frame: number;
  seconds: number;
  warnings: string[];
  error: string | null;
  result: Result | null;
}

interface Question {
  probe: number;
  channel: number;
  point: Point;
  frame: number;
  askedAt: number;
}

export class ExplainPanel {
  /** The probe that is explained; -1: none. */
  chosen = -1;
  /** What is known of each probe. */
  readonly found: (Explanation | null)[] = PROBE_COLORS.map(() => null);
  private question: Question | null = null;
  private reason = "";

  constructor(private readonly changed: () => void) {
    element("explain-close").onclick = () => this.close();
  }

  /** Takes why nothing can be explained; empty: everything can. */
  hello(reason: string): void {
    this.reason = reason;
    this.question = null;
    this.found.fill(null);
    this.show();
  }

  /** Chooses a probe, and asks unless its pixel is explained already. */
  choose(probe: number, point: Point, channel: number, frame: Frame | null, link: Link): void {
    this.chosen = probe;
    const known = this.found[probe];
    if (known === null || known.x !== point.x || known.y !== point.y || known.channel !== channel) {
      this.found[probe] = null;
      if (this.reason === "" && frame !== null) this.ask(probe, point, channel, frame, link);
    }
    this.show();
  }

  /** Asks anew, for the frame that is shown now. */
  again(point: Point, channel: number, frame: Frame | null, link: Link): void {
    if (this.chosen < 0 || frame === null || this.reason !== "") return;
    this.ask(this.chosen, point, channel, frame, link);
    this.show();
  }

  forget(probe: number): void {
    this.found[probe] = null;
    if (this.question?.probe === probe) this.question = null;
    if (this.chosen === probe) this.close();
  }

  close(): void {
    this.chosen = -1;
    this.show();
  }

  take(explanation: Explanation): void {
    const asked = this.question;
    if (asked === null || asked.frame !== explanation.frame || asked.point.x !== explanation.x ||
        asked.point.y !== explanation.y || asked.channel !== explanation.channel) return;
    this.found[asked.probe] = explanation;
    this.question = null;
    this.show();
  }

  /** Takes a refusal of the question. */
  refuse(text: string): void {
    if (this.question === null) return;
    const { probe, channel, point, frame } = this.question;
    this.found[probe] = { channel, x: point.x, y: point.y, frame, seconds: 0, warnings: [], error: text, result: null };
    this.question = null;
    this.show();
  }

  /** Says how long the answer has taken so far. */
  tick(): void {
    const asked = this.question;
    if (asked === null || asked.probe !== this.chosen) return;
    const seconds = ((performance.now() - asked.askedAt) / 1000).toFixed(0);
    element("explain-state").textContent =
      `works out frame ${asked.frame} beside the run: ${seconds} s`;
  }

  draw(channels: Channel[]): void {
    const known = this.chosen < 0 ? null : this.found[this.chosen];
    const result = known?.result ?? null;
    element("explain-body").hidden = result === null;
    if (known === null || result === null) return;
    drawHistory(element<HTMLCanvasElement>("explain-plot"), result);
    showTerms(element<HTMLTableElement>("explain-terms"), bandOf(result, channels[known.channel]?.band ?? ""));
  }

  private ask(probe: number, point: Point, channel: number, frame: Frame, link: Link): void {
    this.question = { probe, channel, point, frame: frame.frame_number, askedAt: performance.now() };
    this.found[probe] = null;
    link.explain(channel, point, frame.frame_number);
  }

  private show(): void {
    const open = this.chosen >= 0;
    element("explain").hidden = !open;
    if (open) {
      const known = this.found[this.chosen];
      element("explain-title").textContent = `Probe ${this.chosen + 1}`;
      element("explain-title").style.color = PROBE_COLORS[this.chosen];
      element("explain-state").textContent = this.reason !== "" ? this.reason : known === null ? "" : headline(known);
      element("explain-state").className = known?.error ? "bad" : "";
      element("explain-notes").textContent = known === null || known.result === null ? "" : notes(known, known.result);
      this.tick();
    }
    this.changed();
  }
}

function headline(known: Explanation): string {
  if (known.error !== null) return known.error;
  const result = known.result as Result;
  const surface = result.surface;
  const what = surface === null ? "sky" : `${surface.object}, ${surface.material}`;
  return `${what} \u00b7 frame ${known.frame}, ${result.utc} \u00b7 worked out in ${known.seconds.toFixed(1)} s`;
}

function notes(known: Explanation, result: Result): string {
  const out: string[] = [];
  if (result.surface?.is_entity) {
    out.push("The point is followed on its body. What it would take without memory is given for scenery alone.");
  } else if (result.surface !== null && result.history.every((row) => row.equilibrium_k === null)) {
    out.push("What it would take without memory is not given for this material.");
  }
  if (result.surface !== null && result.history.length === 0) out.push("The surface has no history.");
  return [...out, ...known.warnings].join(" ");
}

function bandOf(result: Result, name: string): Band | null {
  return result.bands.find((band) => band.band === name) ?? result.bands[0] ?? null;
}

function showTerms(table: HTMLTableElement, band: Band | null): void {
  table.tBodies[0].replaceChildren();
  if (band === null) return;
  const row = (name: string, value: number, share: number | null, kind: string) => {
    const line = table.tBodies[0].insertRow();
    line.className = kind;
    line.insertCell().textContent = name;
    line.insertCell().textContent = value.toPrecision(5);
    const cell = line.insertCell();
    if (share === null) return;
    const meter = document.createElement("meter");
    meter.max = 1;
    meter.value = Math.max(0, share);
    meter.title = `${(100 * share).toFixed(1)} %`;
    cell.append(meter, ` ${(100 * share).toFixed(1)} %`);
  };
  for (const [key, name] of TERMS) {
    const value = band.terms[key] ?? 0;
    if (value !== 0) row(name, value, band.sum_w_m2_sr === 0 ? 0 : value / band.sum_w_m2_sr, "");
  }
  row(`pixel in ${band.band}, ${band.apparent_k.toFixed(2)} K`, band.pixel_w_m2_sr, null, "sum");
}

/** Colour of the strip where a face gets so much of the largest sun of its history. */
function sunColor(share: number): string {
  const part = (dark: number, bright: number) => Math.round(dark + Math.min(Math.max(share, 0), 1) * (bright - dark));
  return `rgb(${part(96, 255)},${part(78, 214)},${part(28, 92)})`;
}

function drawHistory(canvas: HTMLCanvasElement, result: Result): void {
  const context = prepared(canvas);
  if (context === null) return;
  const width = canvas.clientWidth;
  const height = canvas.clientHeight;
  context.fillStyle = "#0b0f14";
  context.fillRect(0, 0, width, height);
  context.font = FONT;
  const rows = result.history;
  if (rows.length < 2) {
    context.fillStyle = TEXT;
    context.fillText("no history", 10, height / 2 + 4);
    return;
  }
  const left = 52;
  const right = width - 8;
  const from = rows[0].sim_time_s;
  const to = rows[rows.length - 1].sim_time_s;
  const x = (time: number) => left + ((time - from) / (to - from)) * (right - left);
  drawSunStrip(context, rows, x, left);
  drawTemperatures(context, rows, x, left, right, height, result);
}

function drawSunStrip(
  context: CanvasRenderingContext2D, rows: Row[], x: (time: number) => number, left: number,
): void {
  const top = 5;
  const tall = 16;
  const most = Math.max(LIT_W_M2, ...rows.map((row) => row.sun_w_m2 ?? 0));
  rows.forEach((row, i) => {
    const begin = i === 0 ? row.sim_time_s : 0.5 * (rows[i - 1].sim_time_s + row.sim_time_s);
    const end = i + 1 === rows.length ? row.sim_time_s : 0.5 * (row.sim_time_s + rows[i + 1].sim_time_s);
    const sun = row.sun_w_m2 ?? 0;
    context.fillStyle = sun < LIT_W_M2 ? "#151b22" : sunColor(sun / most);
    context.fillRect(x(begin), top, x(end) - x(begin) + 0.5, tall);
  });
  context.fillStyle = TEXT;
  context.textAlign = "right";
  context.fillText("sun", left - 6, top + 12);
  context.textAlign = "left";
}

function drawTemperatures(
  context: CanvasRenderingContext2D, rows: Row[], x: (time: number) => number, left: number, right: number,
  height: number, result: Result,
): void {
  const top = 42;
  const bottom = height - 16;
  const values = rows
    .flatMap((row) => [row.temperature_k, row.equilibrium_k])
    .filter((one) => one !== null) as number[];
  if (values.length === 0) return;
  const lowest = Math.min(...values);
  const highest = Math.max(...values);
  const margin = Math.max(0.5, 0.06 * (highest - lowest));
  const low = lowest - margin;
  const high = highest + margin;
  const y = (kelvin: number) => bottom - ((kelvin - low) / (high - low)) * (bottom - top);
  const line = (x1: number, y1: number, x2: number, y2: number) => {
    context.beginPath();
    context.moveTo(x1, y1);
    context.lineTo(x2, y2);
    context.stroke();
  };
  context.strokeStyle = GRID;
  context.fillStyle = TEXT;
  context.lineWidth = 1;
  context.textAlign = "right";
  for (const mark of ticks(low, high, Math.max(2, Math.floor((bottom - top) / 30)))) {
    line(left, y(mark), right, y(mark));
    context.fillText(`${mark.toFixed(0)} K`, left - 5, y(mark) + 4);
  }
  drawHours(context, rows, x, line, top, bottom, height, result);
  const draw = (value: (row: Row) => number | null, color: string, wide: number) => {
    context.strokeStyle = color;
    context.lineWidth = wide;
    context.beginPath();
    let pen = false;
    for (const row of rows) {
      const kelvin = value(row);
      if (kelvin === null) {
        pen = false;
        continue;
      }
      if (pen) context.lineTo(x(row.sim_time_s), y(kelvin));
      else context.moveTo(x(row.sim_time_s), y(kelvin));
      pen = true;
    }
    context.stroke();
  };
  draw((row) => row.equilibrium_k, EQUILIBRIUM, 1.2);
  draw((row) => row.temperature_k, SURFACE, 2);
  const last = rows[rows.length - 1];
  context.textAlign = "left";
  let at = left;
  const legend = (text: string, kelvin: number | null, color: string) => {
    if (kelvin === null) return;
    const words = `${text} ${kelvin.toFixed(2)} K`;
    context.fillStyle = color;
    context.fillText(words, at, top - 6);
    at += context.measureText(words).width + 16;
  };
  legend("surface", last.temperature_k, SURFACE);
  legend("without memory", last.equilibrium_k, EQUILIBRIUM);
}

/** Draws lines at full hours of UTC. */
function drawHours(
  context: CanvasRenderingContext2D, rows: Row[], x: (time: number) => number,
  line: (x1: number, y1: number, x2: number, y2: number) => void, top: number, bottom: number, height: number,
  result: Result,
): void {
  const now = Date.parse(result.utc) / 1000;
  const hourPx = x(rows[0].sim_time_s + 3600) - x(rows[0].sim_time_s);
  const step = [1, 2, 3, 6, 12].find((hours) => hours * hourPx > 34) ?? 24;
  const first = Math.ceil((now - (result.sim_time_s - rows[0].sim_time_s)) / 3600);
  context.textAlign = "right";
  context.fillStyle = TEXT;
  context.fillText("UTC", x(rows[0].sim_time_s) - 6, height - 3);
  context.textAlign = "center";
  for (let hour = first; 3600 * hour <= now; ++hour) {
    if (hour % step !== 0) continue;
    const at = x(result.sim_time_s - (now - 3600 * hour));
    context.strokeStyle = GRID;
    line(at, top, at, bottom);
    context.fillStyle = TEXT;
    context.fillText(`${String(hour % 24).padStart(2, "0")}h`, at, height - 3);
  }
}
