// SPDX-License-Identifier: Apache-2.0
// The bar of a replayed recording: its span with what happened, where the replay is, and its commands.

import { element } from "./display.js";
import { Link } from "./link.js";
import { prepared, ticks } from "./strips.js";

const TEXT = "#8fa1b3";
const RUN = "#dbe4ec";
const PLAYED = "#16303d";
const NOW = "#6fd3ff";
const TARGET = "#e6b450";
const FONT = '11px "DejaVu Sans", sans-serif';
const MARK_COLORS: Record<string, string> = {
  run: RUN, command: "#e6b450", weather: "#9bef8b", part: "#d5a6ff", late: "#ff5d5d",
};
/** Reach of the pointer to a mark, px. */
const REACH_PX = 5;
const RATES = ["0.1", "0.25", "0.5", "1", "2", "4", "10", "max"];

export interface Recording {
  frames: number;
  length_s: number;
  runs: { id: string; from_s: number }[];
  /** Kind, position in s and text. */
  marks: [string, number, string][];
  /** Positions and simulation times in s, ascending in position. */
  times: [number, number][];
}

export interface ReplayState {
  playing: boolean;
  rate: number;
  frame: number | null;
  position_s: number;
  sim_time_s: number;
  target_s: number | null;
  reached_s: number | null;
  loop_s: [number, number] | null;
}

export class ReplayBar {
  recording: Recording | null = null;
  state: ReplayState | null = null;
  /** Position under the pointer in s; null: it is elsewhere. */
  private hover: number | null = null;
  private dragging = false;
  private loopFrom: number | null = null;
  private readonly bar = element<HTMLCanvasElement>("replay-bar");

  constructor(private readonly link: () => Link, private readonly say: (text: string) => void) {
    const rate = element<HTMLSelectElement>("replay-rate");
    rate.replaceChildren(...RATES.map((one) => new Option(one === "max" ? "max" : `\u00d7 ${one}`, one)));
    rate.onchange = () => this.send(`rate ${rate.value}`);
    element("replay-play").onclick = () => this.toggle();
    element("replay-begin").onclick = () => this.send("begin");
    element("replay-back").onclick = () => this.move(-1);
    element("replay-step").onclick = () => this.move(1);
    element("replay-loop").onclick = () => this.loop();
    this.bindBar();
    new ResizeObserver(() => this.draw()).observe(this.bar);
  }

  get active(): boolean {
    return this.recording !== null;
  }

  hello(recording: Recording | null): void {
    this.recording = recording;
    element("replay").hidden = recording === null;
    document.body.classList.toggle("replays", recording !== null);
    this.draw();
  }

  /** Takes the state. Returns what the page calls it; null: nothing is replayed. */
  status(state: ReplayState | null): string | null {
    this.state = state;
    if (state === null || this.recording === null) return null;
    const length = this.recording.length_s;
    element("replay-play").textContent = state.playing ? "Hold" : "Play";
    element("replay-play").classList.toggle("on", state.playing);
    const rate = element<HTMLSelectElement>("replay-rate");
    if (document.activeElement !== rate) rate.value = state.rate === 0 ? "max" : String(state.rate);
    element("replay-loop").classList.toggle("on", state.loop_s !== null || this.loopFrom !== null);
    element("replay-where").textContent = state.target_s === null
      ? `${state.position_s.toFixed(3)} of ${length.toFixed(3)} s \u00b7 simulation ${state.sim_time_s.toFixed(3)} s`
      : `on the way to ${state.target_s.toFixed(3)} s: ${(state.reached_s ?? 0).toFixed(3)} s`;
    this.bar.setAttribute("aria-valuemax", length.toFixed(3));
    this.bar.setAttribute("aria-valuenow", state.position_s.toFixed(3));
    this.bar.setAttribute("aria-valuetext", `simulation time ${state.sim_time_s.toFixed(3)} s`);
    this.draw();
    return state.target_s !== null ? "seeking" : state.playing ? "playing" : "held";
  }

  /** Plays, or holds. */
  toggle(): void {
    this.send(this.state?.playing ? "hold" : "play");
  }

  move(frames: number): void {
    this.send(`move ${frames}`);
  }

  seek(position: number): void {
    if (this.recording === null) return;
    const to = Math.min(Math.max(position, 0), this.recording.length_s);
    this.send(`seek ${to.toFixed(9)}`);
  }

  /** Seeks by seconds from where the replay is or goes to. */
  seekBy(seconds: number): void {
    if (this.state !== null) this.seek((this.state.target_s ?? this.state.position_s) + seconds);
  }

  /** Goes to the next mark, or the one before. */
  seekMark(step: 1 | -1): void {
    if (this.recording === null || this.state === null) return;
    const at = this.state.target_s ?? this.state.position_s;
    const places = this.recording.marks.map((mark) => mark[1]);
    const found = step > 0 ? places.find((one) => one > at + 1e-6) : places.filter((one) => one < at - 1e-6).pop();
    if (found !== undefined) this.seek(found);
  }

  /** Notes the begin of a loop, then its end, then plays on again. */
  loop(): void {
    if (this.state === null) return;
    if (this.state.loop_s !== null) {
      this.send("loop off");
    } else if (this.loopFrom === null) {
      this.loopFrom = this.state.position_s;
      this.say("the loop begins here: go to its end and press again");
    } else {
      const [from, to] = [this.loopFrom, this.state.position_s].sort((a, b) => a - b);
      this.loopFrom = null;
      this.send(`loop ${from.toFixed(9)} ${to.toFixed(9)}`);
    }
  }

  /** Returns the simulation time at a position, between those that are known. */
  simTimeAt(position: number): number {
    const times = this.recording?.times ?? [];
    const after = times.findIndex((one) => one[0] >= position);
    if (after < 0) return times.length === 0 ? NaN : times[times.length - 1][1];
    if (after === 0) return times[0][1];
    const [p, s] = times[after - 1];
    const [q, t] = times[after];
    return q > p ? s + ((position - p) / (q - p)) * (t - s) : t;
  }

  /** Returns where a position lies on the bar, px from its left. */
  placeOf(position: number): number {
    const length = Math.max(this.recording?.length_s ?? 0, 1e-9);
    return 8 + (position / length) * (this.bar.clientWidth - 16);
  }

  private send(words: string): void {
    if (this.active) this.link().replay(words);
  }

  private positionAt(clientX: number): number {
    const box = this.bar.getBoundingClientRect();
    const share = (clientX - box.left - 8) / Math.max(box.width - 16, 1);
    return Math.min(Math.max(share, 0), 1) * (this.recording?.length_s ?? 0);
  }

  private bindBar(): void {
    this.bar.onpointerdown = (event) => {
      if (event.button !== 0) return;
      this.bar.setPointerCapture(event.pointerId);
      this.dragging = true;
      this.hover = this.positionAt(event.clientX);
      this.draw();
    };
    this.bar.onpointermove = (event) => {
      this.hover = this.positionAt(event.clientX);
      this.draw();
    };
    this.bar.onpointerup = (event) => {
      if (!this.dragging) return;
      this.dragging = false;
      this.seek(this.snapped(this.positionAt(event.clientX)));
    };
    this.bar.onpointercancel = () => { this.dragging = false; };
    this.bar.onpointerleave = () => {
      if (this.dragging) return;
      this.hover = null;
      this.draw();
    };
    this.bar.onkeydown = (event) => {
      const run = this.keys(event.key, event.shiftKey);
      if (run === null || event.ctrlKey || event.altKey || event.metaKey) return;
      event.preventDefault();
      event.stopPropagation();
      run();
    };
  }

  /** What a key does while the bar has the focus. */
  private keys(key: string, shift: boolean): (() => void) | null {
    const length = this.recording?.length_s ?? 0;
    switch (key) {
      case "ArrowLeft": return () => this.move(shift ? -10 : -1);
      case "ArrowRight": return () => this.move(shift ? 10 : 1);
      case "Home": return () => this.send("begin");
      case "End": return () => this.seek(length);
      case "PageUp": return () => this.seekMark(-1);
      case "PageDown": return () => this.seekMark(1);
      case "Enter": return () => this.toggle();
      default: return null;
    }
  }

  /** Returns the position of a mark under the pointer, else the position itself. */
  private snapped(position: number): number {
    return this.markNear(position)?.[1] ?? position;
  }

  private markNear(position: number): [string, number, string] | null {
    const at = this.placeOf(position);
    let best: [string, number, string] | null = null;
    let reach = REACH_PX;
    for (const mark of this.recording?.marks ?? []) {
      const distance = Math.abs(this.placeOf(mark[1]) - at);
      if (distance < reach) {
        reach = distance;
        best = mark;
      }
    }
    return best;
  }

  draw(): void {
    const recording = this.recording;
    const context = recording === null ? null : prepared(this.bar);
    if (context === null || recording === null) return;
    const width = this.bar.clientWidth;
    const height = this.bar.clientHeight;
    const top = 16;
    const bottom = height - 15;
    context.clearRect(0, 0, width, height);
    context.font = FONT;
    context.fillStyle = "#0b0f14";
    context.fillRect(8, top, width - 16, bottom - top);
    const at = this.state?.position_s ?? 0;
    context.fillStyle = PLAYED;
    context.fillRect(8, top, this.placeOf(at) - 8, bottom - top);
    const loop = this.state?.loop_s ?? null;
    if (loop !== null) {
      context.fillStyle = "rgba(123, 216, 143, 0.22)";
      context.fillRect(this.placeOf(loop[0]), top, this.placeOf(loop[1]) - this.placeOf(loop[0]), bottom - top);
    }
    context.fillStyle = TEXT;
    context.textAlign = "center";
    for (const mark of ticks(0, recording.length_s, Math.max(2, Math.floor(width / 110)))) {
      context.fillRect(this.placeOf(mark), bottom, 1, 3);
      const at = Math.min(Math.max(this.placeOf(mark), 18), width - 22);
      context.fillText(`${Number(mark.toPrecision(6))} s`, at, height - 2);
    }
    for (const [kind, position] of recording.marks) {
      const tall = kind === "run" ? bottom - top : kind === "late" ? 5 : 9;
      context.fillStyle = MARK_COLORS[kind] ?? TEXT;
      context.fillRect(this.placeOf(position) - 1, kind === "late" ? bottom - tall : top, 2, tall);
    }
    const needle = (position: number, color: string, wide: number) => {
      context.fillStyle = color;
      context.fillRect(this.placeOf(position) - wide / 2, top - 3, wide, bottom - top + 6);
    };
    if (this.state !== null && this.state.target_s !== null) needle(this.state.target_s, TARGET, 2);
    if (this.loopFrom !== null) needle(this.loopFrom, "#7bd88f", 2);
    needle(at, NOW, 3);
    if (this.hover !== null) this.drawHover(context, width, needle);
  }

  private drawHover(
    context: CanvasRenderingContext2D, width: number, needle: (at: number, color: string, wide: number) => void,
  ): void {
    const position = this.hover as number;
    const mark = this.markNear(position);
    const place = mark?.[1] ?? position;
    needle(place, this.dragging ? TARGET : "rgba(200, 214, 229, 0.6)", this.dragging ? 3 : 1);
    const words = [`${place.toFixed(3)} s`, `simulation ${this.simTimeAt(place).toFixed(3)} s`];
    if (mark !== null) words.push(mark[2]);
    const text = words.join(" \u00b7 ");
    const half = context.measureText(text).width / 2 + 4;
    context.fillStyle = RUN;
    context.fillText(text, Math.min(Math.max(this.placeOf(place), half), width - half), 11);
  }
}
