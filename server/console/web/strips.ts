// SPDX-License-Identifier: Apache-2.0
// Strip charts: values over the last seconds, newest at the right.

const BACKGROUND = "#0b0f14";
const GRID = "#1c252f";
const TEXT = "#8fa1b3";
const DEADLINE = "#ff5d5d";

/** The latest values of one line, by time in seconds. */
export class Series {
  private readonly times: Float64Array;
  private readonly values: Float64Array;
  private first = 0;
  private count = 0;

  constructor(readonly color: string, capacity: number) {
    this.times = new Float64Array(capacity);
    this.values = new Float64Array(capacity);
  }

  add(time: number, value: number): void {
    const at = (this.first + this.count) % this.times.length;
    this.times[at] = time;
    this.values[at] = value;
    if (this.count < this.times.length) ++this.count;
    else this.first = (this.first + 1) % this.times.length;
  }

  clear(): void {
    this.first = 0;
    this.count = 0;
  }

  get last(): number {
    return this.count === 0 ? NaN : this.values[(this.first + this.count - 1) % this.values.length];
  }

  /** Calls back for each value not older than `from`, the oldest first. */
  each(from: number, call: (time: number, value: number) => void): void {
    for (let i = 0; i < this.count; ++i) {
      const at = (this.first + i) % this.times.length;
      if (this.times[at] >= from) call(this.times[at], this.values[at]);
    }
  }
}

/** Returns round numbers within a range. */
export function ticks(low: number, high: number, count: number): number[] {
  const range = high - low;
  if (!(range > 0)) return [low];
  const raw = range / count;
  const power = Math.pow(10, Math.floor(Math.log10(raw)));
  const step = [1, 2, 5, 10].map((factor) => factor * power).find((one) => one >= raw) ?? raw;
  const out: number[] = [];
  for (let value = Math.ceil(low / step) * step; value <= high + 1e-9 * step; value += step) out.push(value);
  return out;
}

/** Gives a canvas the size that it is shown with. Returns its context; null: it is not shown. */
export function prepared(canvas: HTMLCanvasElement): CanvasRenderingContext2D | null {
  const context = canvas.getContext("2d");
  const ratio = window.devicePixelRatio || 1;
  const width = Math.round(canvas.clientWidth * ratio);
  const height = Math.round(canvas.clientHeight * ratio);
  if (context === null || width === 0 || height === 0) return null;
  if (canvas.width !== width || canvas.height !== height) {
    canvas.width = width;
    canvas.height = height;
  }
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  return context;
}

export interface StripOptions {
  seconds: number;
  fromZero: boolean;
  unit: string;
  /** Values are dots, one for each frame, instead of a line. */
  dots: boolean;
}

export class Strip {
  /** Deadline of the newest frame; NaN: none. */
  deadline = NaN;

  constructor(
    private readonly canvas: HTMLCanvasElement,
    readonly series: Series[],
    private readonly options: StripOptions,
  ) {}

  draw(now: number): void {
    const context = prepared(this.canvas);
    if (context === null) return;
    const width = this.canvas.clientWidth;
    const height = this.canvas.clientHeight;
    context.fillStyle = BACKGROUND;
    context.fillRect(0, 0, width, height);
    const from = now - this.options.seconds;
    let low = this.options.fromZero ? 0 : Infinity;
    let high = -Infinity;
    for (const series of this.series) {
      series.each(from, (_, value) => {
        if (!Number.isFinite(value)) return;
        low = Math.min(low, value);
        high = Math.max(high, value);
      });
    }
    if (Number.isFinite(this.deadline)) high = Math.max(high, 1.08 * this.deadline);
    if (!Number.isFinite(low) || !Number.isFinite(high)) {
      context.fillStyle = TEXT;
      context.font = '12px "DejaVu Sans", sans-serif';
      context.fillText("no values yet", 10, height / 2 + 4);
      return;
    }
    if (!(high > low)) {
      const spread = Math.max(Math.abs(high) * 1e-4, 1e-6);
      high += spread;
      if (!this.options.fromZero) low -= spread;
    }
    const margin = this.options.fromZero ? 0 : 0.08 * (high - low);
    low -= margin;
    high += 0.08 * (high - low);
    const left = 52;
    const right = width - 6;
    const bottom = height - 15;
    const x = (time: number) => left + ((time - from) / this.options.seconds) * (right - left);
    const y = (value: number) => bottom - ((value - low) / (high - low)) * (bottom - 6);
    context.font = '11px "DejaVu Sans", sans-serif';
    context.lineWidth = 1;
    context.textAlign = "right";
    const marks = ticks(low, high, Math.max(2, Math.floor(height / 36)));
    const step = marks.length > 1 ? marks[1] - marks[0] : 1;
    const decimals = Math.min(6, Math.max(0, Math.ceil(-Math.log10(step) - 1e-9)));
    for (const mark of marks) {
      const at = Math.round(y(mark)) + 0.5;
      context.strokeStyle = GRID;
      context.beginPath();
      context.moveTo(left, at);
      context.lineTo(right, at);
      context.stroke();
      context.fillStyle = TEXT;
      context.fillText(mark.toFixed(decimals), left - 5, at + 3.5);
    }
    context.textAlign = "left";
    context.fillText(`${this.options.seconds} s`, left, height - 3);
    context.textAlign = "right";
    context.fillText("now", right, height - 3);
    context.textAlign = "left";
    context.save();
    context.beginPath();
    context.rect(left, 0, right - left, bottom + 1);
    context.clip();
    for (const series of this.series) this.drawSeries(context, series, from, x, y);
    context.restore();
    if (Number.isFinite(this.deadline)) {
      const at = y(this.deadline);
      context.strokeStyle = DEADLINE;
      context.setLineDash([6, 4]);
      context.beginPath();
      context.moveTo(left, at);
      context.lineTo(right, at);
      context.stroke();
      context.setLineDash([]);
      context.fillStyle = DEADLINE;
      context.textAlign = "right";
      const label = `deadline ${this.deadline.toFixed(2)} ${this.options.unit}`;
      context.fillText(label, right - 2, at > 18 ? at - 4 : at + 12);
      context.textAlign = "left";
    }
  }

  private drawSeries(
    context: CanvasRenderingContext2D,
    series: Series,
    from: number,
    x: (time: number) => number,
    y: (value: number) => number,
  ): void {
    context.strokeStyle = series.color;
    context.fillStyle = series.color;
    if (this.options.dots) {
      series.each(from, (time, value) => {
        const late = Number.isFinite(this.deadline) && value > this.deadline;
        context.fillStyle = late ? DEADLINE : series.color;
        context.fillRect(x(time) - 0.75, y(value) - (late ? 2 : 0.75), 1.5, late ? 4 : 1.5);
      });
      return;
    }
    context.lineWidth = 1.5;
    context.beginPath();
    let pen = false;
    series.each(from, (time, value) => {
      if (!Number.isFinite(value)) {
        pen = false;
        return;
      }
      if (pen) context.lineTo(x(time), y(value));
      else context.moveTo(x(time), y(value));
      pen = true;
    });
    context.stroke();
    context.lineWidth = 1;
  }
}
