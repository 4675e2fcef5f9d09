// SPDX-License-Identifier: Apache-2.0
// The connection to emitd: what it sends, and how the page comes back after a restart.

import { Explanation } from "./explain.js";
import { Point } from "./image.js";
import { Recording, ReplayState } from "./replay.js";

export interface Channel {
  index: number;
  name: string;
  kind: string;
  sensor: string;
  band: string;
  lo_um: number;
  hi_um: number;
  width_px: number;
  height_px: number;
  every_nth: number;
  radiance: boolean;
  quantity: string; // what the pixels hold
  unit: string;
  temperature: boolean;
}

export interface Hello {
  software: string;
  scenario: string;
  pacing: string;
  device: string;
  rate_hz: number;
  budget_ns: number;
  image_rate_hz: number;
  motion: boolean;
  may_command: boolean;
  table_from_k: number;
  table_step_k: number;
  nan_color: string;
  colors: Record<string, string>;
  /** Why pixels cannot be explained; empty: they can. */
  no_explanation: string;
  recording: Recording | null;
  channels: Channel[];
  flags: string[];
  counters: [string, string][];
}

export interface Client {
  peer: string;
  role: string;
  software: string;
  channel: string;
  transport: string;
  frames?: number;
  skipped?: number;
  delay_us?: number;
  jitter_us?: number;
}

export interface Warning {
  level: string;
  text: string;
  count: number;
  age_s: number;
}

export interface Axes {
  state: number;
  faults: number;
  age_us: number | null;
  measured_deg: number[];
  commanded_deg: number[];
  /** Age at the status in ms; angles measured, and those commanded for that instant, none unless emitd commands. */
  ticks: [number, number[], number[]][];
}

/** What a host wants people to see. Its limits have no meaning with automatic gain. */
export interface Picture {
  on: boolean;
  black_hot: boolean;
  automatic_gain: boolean;
  low_k: number;
  high_k: number;
}

/** Frame number, flags, age at the status in ms; frame time, its deadline, latency, its deadline in us. */
export type Tick = [number, number, number, number | null, number | null, number | null, number | null];

export interface Status {
  tai_ms: number;
  run_id: string;
  ready: boolean;
  running: boolean;
  held: boolean;
  uptime_s: number;
  pages: number;
  journal_bytes: number;
  counters: Record<string, number>;
  clients: Client[];
  warnings: Warning[];
  agents: { name: string; max_us: number; over: number; busy_s: number }[];
  replay: ReplayState | null;
  axes: Axes;
  picture: Picture | null;
  ticks: Tick[];
}

export interface Answer {
  ok: boolean;
  command: string;
  text: string;
}

/** An image, in the layout that docs/console.md describes. */
export interface Frame {
  sequence: number;
  run_id: string;
  frame_number: number;
  host_frame_number: number;
  sim_time_s: number;
  width_px: number;
  height_px: number;
  channel: number;
  quantity: number;
  quality_level: number;
  flags: number;
  band_lo_um: number;
  band_hi_um: number;
  estimated_error_k: number;
  nonfinite_px: number;
  clamped_px: number;
  motion_state: number;
  motion_faults: number;
  shift_x_px: number;
  shift_y_px: number;
  pointing_error_px: number;
  crc32c: number;
  pixels: Float32Array;
}

const MAGIC = 0x46434d45;
const VERSION = 1;

/** Returns the image of a message; null for a message that this page does not understand. */
export function parseFrame(message: ArrayBuffer): Frame | null {
  if (message.byteLength < 128) return null;
  const view = new DataView(message);
  const headerBytes = view.getUint16(6, true);
  if (view.getUint32(0, true) !== MAGIC || view.getUint16(4, true) !== VERSION) return null;
  const width = view.getUint32(48, true);
  const height = view.getUint32(52, true);
  if (message.byteLength !== headerBytes + 4 * width * height) return null;
  return {
    sequence: Number(view.getBigUint64(8, true)),
    run_id: view.getBigUint64(16, true).toString(),
    frame_number: Number(view.getBigUint64(24, true)),
    host_frame_number: Number(view.getBigUint64(32, true)),
    sim_time_s: Number(view.getBigInt64(40, true)) / 1e9,
    width_px: width,
    height_px: height,
    channel: view.getUint16(56, true),
    quantity: view.getUint8(58),
    quality_level: view.getUint8(59),
    flags: view.getUint32(60, true),
    band_lo_um: view.getFloat32(64, true),
    band_hi_um: view.getFloat32(68, true),
    estimated_error_k: view.getFloat32(72, true),
    nonfinite_px: view.getUint32(76, true),
    clamped_px: view.getUint32(80, true),
    motion_state: view.getUint8(84),
    motion_faults: view.getUint8(85),
    shift_x_px: view.getFloat32(88, true),
    shift_y_px: view.getFloat32(92, true),
    pointing_error_px: view.getFloat32(96, true),
    crc32c: view.getUint32(104, true),
    pixels: new Float32Array(message, headerBytes, width * height),
  };
}

export interface Listener {
  hello(hello: Hello): void;
  status(status: Status): void;
  answer(answer: Answer): void;
  explanation(explanation: Explanation): void;
  frame(frame: Frame): void;
  lost(): void;
}

const FIRST_RETRY_MS = 250;
const LAST_RETRY_MS = 2000;
const SILENCE_MS = 4000;

export class Link {
  private socket: WebSocket | null = null;
  private retryMs = FIRST_RETRY_MS;
  private heardMs = 0;
  private opened = false;

  constructor(private readonly listener: Listener) {
    this.open();
    // A daemon that is killed with its host closes nothing.
    window.setInterval(() => {
      if (this.opened && performance.now() - this.heardMs > SILENCE_MS) this.socket?.close();
    }, 1000);
  }

  /** Asks for the next image of a channel. */
  next(channel: number): void {
    this.send(`next ${channel}`);
  }

  command(word: string): void {
    this.send(`command ${word}`);
  }

  /** Asks how the surface in a pixel of a frame came to its temperature. */
  explain(channel: number, point: Point, frame: number): void {
    this.send(`explain ${channel} ${point.x} ${point.y} ${frame}`);
  }

  replay(words: string): void {
    this.send(`replay ${words}`);
  }

  get connected(): boolean {
    return this.opened;
  }

  private send(text: string): void {
    if (this.opened && this.socket?.readyState === WebSocket.OPEN) this.socket.send(text);
  }

  private open(): void {
    const socket = new WebSocket(`ws://${location.host}/live`);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    socket.onopen = () => {
      this.opened = true;
      this.retryMs = FIRST_RETRY_MS;
      this.heardMs = performance.now();
    };
    socket.onmessage = (event: MessageEvent) => {
      this.heardMs = performance.now();
      if (typeof event.data === "string") this.takeText(event.data);
      else this.takeBytes(event.data as ArrayBuffer);
    };
    socket.onclose = () => {
      if (this.opened) this.listener.lost();
      this.opened = false;
      window.setTimeout(() => this.open(), this.retryMs);
      this.retryMs = Math.min(2 * this.retryMs, LAST_RETRY_MS);
    };
  }

  private takeText(text: string): void {
    const message = JSON.parse(text) as { type: string };
    if (message.type === "hello") this.listener.hello(message as unknown as Hello);
    else if (message.type === "status") this.listener.status(message as unknown as Status);
    else if (message.type === "explanation") this.listener.explanation(message as unknown as Explanation);
    else if (message.type === "answer") this.listener.answer(message as unknown as Answer);
  }

  private takeBytes(bytes: ArrayBuffer): void {
    const frame = parseFrame(bytes);
    if (frame !== null) this.listener.frame(frame);
  }
}
