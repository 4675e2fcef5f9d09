// SPDX-License-Identifier: Apache-2.0
// The operator's console: wires image, limits, probes, strips and commands together.

import { AxesPanel } from "./axes.js";
import { colorTable, cssColor, PROBE_COLORS, reversed } from "./colors.js";
import { channelName, duration, element, Panels, Toast } from "./display.js";
import { ImageView, percentiles, Point } from "./image.js";
import { bindKeys } from "./keys.js";
import { Answer, Frame, Hello, Link, Picture, Status } from "./link.js";
import { MAX_PROBES, Probes } from "./probes.js";
import { Series, Strip, ticks } from "./strips.js";
import { fetchTable, TemperatureTable } from "./temperature.js";

const COMMANDS = ["start", "stop", "hold", "step", "reset"];
const AUTO_PERIOD_MS = 500;
const PROBE_SECONDS = 60;
const FRAME_SECONDS = 10;
const STALE_S = 2;
/** A reset is asked for twice within this time. */
const CONFIRM_MS = 3000;

class Console {
  private readonly image = new ImageView(element("image"), element("overlay"));
  private readonly panels = new Panels();
  private readonly axes = new AxesPanel();
  private readonly toast = new Toast();
  private readonly probes = new Probes();
  private readonly link: Link;
  private facts: Hello | null = null;
  private tables = new Map<number, TemperatureTable>();
  private channel = 0;
  private kelvins = true;
  private map = "thermal";
  private colors = new Uint8Array(1024);
  /** Limits are not set by hand. */
  private auto = true;
  private picture: Picture | null = null;
  private low = 0;
  private high = 1;
  private autoAt = -Infinity;
  private frozen = false;
  private cursor: Point | null = null;
  private frameAt = 0;
  private frames: number[] = [];
  private resetAt = -Infinity;
  private runId = "";
  private readonly frameTimes = new Series("#6fd3ff", 4096);
  private readonly latencies = new Series("#9bef8b", 4096);
  private readonly probeStrip: Strip;
  private readonly frameStrip: Strip;
  private readonly latencyStrip: Strip;

  constructor() {
    this.probeStrip = new Strip(element("probe-strip"), this.probes.shown, {
      seconds: PROBE_SECONDS, fromZero: false, unit: "", dots: false,
    });
    this.frameStrip = new Strip(element("frame-strip"), [this.frameTimes], {
      seconds: FRAME_SECONDS, fromZero: true, unit: "ms", dots: true,
    });
    this.latencyStrip = new Strip(element("latency-strip"), [this.latencies], {
      seconds: FRAME_SECONDS, fromZero: true, unit: "ms", dots: true,
    });
    this.restore();
    this.bind();
    this.link = new Link(this);
    window.setInterval(() => this.look(), 250);
    (window as unknown as { emitConsole: Console }).emitConsole = this;
  }

  // What emitd sends.

  hello(hello: Hello): void {
    this.facts = hello;
    this.tables.clear();
    if (this.channel >= hello.channels.length) this.channel = 0;
    this.panels.hello(hello);
    this.axes.show(hello.motion);
    element("title").textContent = hello.scenario || "canned frames";
    element("about").textContent = `${hello.software} \u00b7 ${hello.pacing} \u00b7 ${hello.device}`;
    const select = element<HTMLSelectElement>("channel");
    select.replaceChildren(
      ...hello.channels.map((channel) => new Option(`${channel.index}  ${channelName(channel)}`, String(channel.index))),
    );
    for (const word of COMMANDS) element<HTMLButtonElement>(word).disabled = !hello.may_command;
    element("no-commands").hidden = hello.may_command;
    document.body.classList.remove("lost");
    this.applyMap();
    this.chooseChannel(this.channel);
  }

  status(status: Status): void {
    this.panels.status(status);
    this.axes.take(status.axes);
    this.takePicture(status.picture);
    const state = !status.running ? "stopped" : status.held ? "held" : "running";
    const pill = element("state");
    pill.textContent = status.ready ? state : "not ready";
    pill.className = `pill ${status.ready ? state : "stopped"}`;
    element("start").classList.toggle("on", state === "running");
    element("stop").classList.toggle("on", state === "stopped");
    element("hold").classList.toggle("on", state === "held");
    element("uptime").textContent = `up ${duration(status.uptime_s)}`;
    if (status.run_id !== this.runId) {
      this.runId = status.run_id;
      this.frameTimes.clear();
      this.latencies.clear();
    }
    this.takeTicks(status);
  }

  private takeTicks(status: Status): void {
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

  answer(answer: Answer): void {
    this.toast.answer(answer);
  }

  frame(frame: Frame): void {
    // The next one is asked for as late as this one is drawn: a slow page gets fewer.
    window.requestAnimationFrame(() => {
      if (frame.channel === this.channel && !this.frozen) this.show(frame);
      if (!this.frozen) this.link.next(this.channel);
    });
  }

  lost(): void {
    document.body.classList.add("lost");
    element("state").textContent = "no connection";
    element("state").className = "pill stopped";
  }

  private show(frame: Frame): void {
    const now = performance.now();
    this.frameAt = now;
    this.frames.push(now);
    while (this.frames.length > 20) this.frames.shift();
    this.image.setFrame(frame);
    if (this.auto && now - this.autoAt > AUTO_PERIOD_MS) this.findLimits();
    this.image.draw();
    this.probes.sample(now / 1000, (point) => this.image.value(point), this.convert);
    this.showHeader(frame);
    this.showReadings();
    this.probeStrip.draw(now / 1000);
  }

  private showHeader(frame: Frame): void {
    element("frame-number").textContent = String(frame.frame_number);
    element("sim-time").textContent = `${frame.sim_time_s.toFixed(3)} s`;
    const chips = this.facts === null ? [] : this.facts.flags.filter((_, bit) => (frame.flags & (1 << bit)) !== 0);
    if (frame.quality_level > 0) chips.push(`quality level ${frame.quality_level}`);
    const box = element("flags");
    const text = chips.join("|");
    if (box.dataset["text"] !== text) {
      box.dataset["text"] = text;
      box.replaceChildren(
        ...chips.map((chip) => {
          const span = document.createElement("span");
          span.textContent = chip.replace(/_/g, " ");
          span.className = ["late", "repeated", "stale", "non_finite", "motion_fault"].includes(chip) ? "chip bad" : "chip";
          return span;
        }),
      );
    }
  }

  // Quantities.

  private get table(): TemperatureTable | undefined {
    return this.tables.get(this.channel);
  }

  private get showsKelvins(): boolean {
    return this.kelvins && this.table !== undefined;
  }

  private readonly convert = (radiance: number): number =>
    this.showsKelvins ? (this.table as TemperatureTable).kelvin(radiance) : radiance;

  private get unit(): string {
    const channel = this.facts?.channels[this.channel];
    if (channel !== undefined && !channel.radiance) return channel.unit;
    return this.showsKelvins ? "K" : "W m\u207b\u00b2 sr\u207b\u00b9";
  }

  private format(value: number): string {
    if (!Number.isFinite(value)) return "\u2013";
    return this.showsKelvins ? value.toFixed(2) : value.toPrecision(5);
  }

  private chooseChannel(channel: number): void {
    const hello = this.facts;
    if (hello === null) return;
    if (channel !== this.channel) this.probes.clearHistory();
    this.channel = channel;
    element<HTMLSelectElement>("channel").value = String(channel);
    this.autoAt = -Infinity;
    this.save();
    this.link.next(channel);
    if (hello.channels[channel].temperature && !this.tables.has(channel)) {
      fetchTable(channel, hello.table_from_k, hello.table_step_k)
        .then((table) => {
          if (this.facts !== hello) return;
          this.tables.set(channel, table);
          this.quantityChanged();
        })
        .catch((error: Error) => this.toast.show(error.message, false));
    }
    this.quantityChanged();
  }

  private quantityChanged(): void {
    this.probes.convertAll(this.convert);
    element("quantity").textContent = this.showsKelvins
      ? "temperature"
      : (this.facts?.channels[this.channel]?.quantity ?? "radiance");
    (element("quantity") as HTMLButtonElement).disabled = this.table === undefined;
    this.findLimits();
    this.redraw();
  }

  // Limits and colours.

  /** What the page follows of a host: all of its wishes, until the operator sets a limit by hand. */
  private get wish(): Picture | null {
    return this.auto ? this.picture : null;
  }

  private takePicture(picture: Picture | null): void {
    if (JSON.stringify(picture) === JSON.stringify(this.picture)) return;
    this.picture = picture;
    const button = element("auto");
    button.textContent = picture === null ? "Auto" : "Host";
    button.title = picture === null ? "Limits by percentile (R)" : "The picture as the host wants it (R)";
    this.pictureChanged();
  }

  private setAuto(auto: boolean): void {
    this.auto = auto;
    this.pictureChanged();
  }

  private pictureChanged(): void {
    this.image.blank = this.wish !== null && !this.wish.on;
    this.findLimits();
    this.applyMap();
    this.look();
  }

  private findLimits(): void {
    const frame = this.image.frame;
    if (!this.auto || frame === null) {
      this.applyLimits();
      return;
    }
    // Only limits that were found count: the first image sets them, however soon it comes.
    this.autoAt = performance.now();
    const wish = this.wish;
    const table = this.table;
    if (wish !== null && !wish.automatic_gain && table !== undefined) {
      const shown = (kelvin: number) => (this.showsKelvins ? kelvin : table.radianceAt(kelvin));
      this.low = shown(wish.low_k);
      this.high = shown(wish.high_k);
      this.applyLimits();
      return;
    }
    const input = (id: string, fallback: number) => {
      const value = Number.parseFloat(element<HTMLInputElement>(id).value);
      return Number.isFinite(value) ? Math.min(Math.max(value, 0), 100) : fallback;
    };
    const found = percentiles(frame.pixels, input("low-percent", 0.5), input("high-percent", 99.5));
    if (found !== null) {
      this.low = this.convert(found[0]);
      this.high = this.convert(found[1]);
      const spread = this.showsKelvins ? 0.5 : Math.max(1e-6, 1e-4 * Math.abs(this.high));
      if (this.high - this.low < spread) {
        const middle = 0.5 * (this.low + this.high);
        this.low = middle - 0.5 * spread;
        this.high = middle + 0.5 * spread;
      }
    }
    this.applyLimits();
  }

  private applyLimits(): void {
    const range = this.high - this.low;
    const bounds = new Float32Array(255);
    for (let i = 0; i < 255; ++i) {
      const value = this.low + ((i + 0.5) / 255) * range;
      bounds[i] = this.showsKelvins ? (this.table as TemperatureTable).radianceAt(value) : value;
    }
    this.image.setBounds(bounds);
    for (const [id, value] of [["low", this.low], ["high", this.high]] as const) {
      const input = element<HTMLInputElement>(id);
      if (document.activeElement !== input) input.value = this.format(value);
    }
    element("auto").classList.toggle("on", this.auto);
    element("unit").textContent = this.unit;
    this.drawBar();
  }

  private moveLimit(which: "low" | "high", steps: number): void {
    const step = (this.high - this.low) / 40;
    this.setAuto(false);
    if (which === "low") this.low = Math.min(this.low + steps * step, this.high - step);
    else this.high = Math.max(this.high + steps * step, this.low + step);
    this.applyLimits();
    this.redraw();
  }

  private typeLimit(which: "low" | "high"): void {
    const value = Number.parseFloat(element<HTMLInputElement>(which).value);
    if (Number.isFinite(value) && (which === "low" ? value < this.high : value > this.low)) {
      this.setAuto(false);
      this[which] = value;
    } else {
      this.toast.show("the lower limit must be below the upper one", false);
    }
    this.applyLimits();
    this.redraw();
  }

  private applyMap(): void {
    if (this.facts === null) return;
    const colors = colorTable(this.facts.colors[this.map] ?? this.facts.colors["thermal"]);
    this.colors = this.wish?.black_hot ? reversed(colors) : colors;
    this.image.setColors(this.colors, this.facts.nan_color);
    element("map").textContent = this.map;
    this.drawBar();
    this.redraw();
  }

  private drawBar(): void {
    const canvas = element<HTMLCanvasElement>("bar");
    const context = canvas.getContext("2d");
    if (context === null) return;
    const ratio = window.devicePixelRatio || 1;
    const width = canvas.clientWidth;
    const height = canvas.clientHeight;
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    const top = 8;
    const bottom = height - 8;
    for (let y = top; y < bottom; ++y) {
      const entry = Math.round(((bottom - 1 - y) / (bottom - 1 - top)) * 255);
      context.fillStyle = cssColor(this.colors, entry);
      context.fillRect(0, y, 14, 1);
    }
    context.font = '11px "DejaVu Sans", sans-serif';
    context.fillStyle = "#8fa1b3";
    const marks = ticks(this.low, this.high, Math.max(2, Math.floor(height / 60)));
    const step = marks.length > 1 ? marks[1] - marks[0] : 1;
    const decimals = Math.min(6, Math.max(0, Math.ceil(-Math.log10(step) - 1e-9)));
    for (const mark of marks) {
      const y = bottom - ((mark - this.low) / (this.high - this.low)) * (bottom - top);
      context.fillRect(14, Math.round(y), 4, 1);
      context.fillText(mark.toFixed(decimals), 21, y + 4);
    }
  }

  // Cursor and probes.

  private showReadings(): void {
    const box = element("cursor");
    if (this.cursor === null || this.image.frame === null) {
      box.textContent = "move over the image";
    } else {
      const radiance = this.image.value(this.cursor);
      const table = this.table;
      const parts = [`x ${this.cursor.x}  y ${this.cursor.y}`];
      parts.push(`${radiance.toPrecision(6)} ${this.facts?.channels[this.channel].unit ?? ""}`);
      if (table !== undefined) parts.push(`${table.kelvin(radiance).toFixed(2)} K`);
      box.textContent = parts.join("    ");
    }
    const list = element("probes");
    const texts = this.probes.places.map((place, i) =>
      place === null ? "" : `(${place.x}, ${place.y})  ${this.format(this.probes.shown[i].last)}`,
    );
    while (list.children.length < MAX_PROBES) {
      const item = document.createElement("button");
      const index = list.children.length;
      item.title = "Press to take the probe away";
      item.onclick = () => {
        this.probes.takeAway(index);
        this.probesChanged();
      };
      item.style.color = PROBE_COLORS[index];
      list.append(item);
    }
    texts.forEach((text, i) => {
      const item = list.children[i] as HTMLElement;
      item.hidden = text === "";
      item.textContent = `${i + 1}  ${text}`;
    });
    element("probe-hint").hidden = texts.some((text) => text !== "");
    element("probe-unit").textContent = this.unit;
    this.image.drawOverlay(this.probes.places, this.cursor);
  }

  private toggleProbe(point: Point): void {
    const reach = Math.max(3, this.image.size.x / 80);
    if (!this.probes.takeAwayAt(point, reach) && this.probes.put(point) < 0) {
      this.toast.show(`there are at most ${MAX_PROBES} probes`, false);
    }
    this.probesChanged();
  }

  private probesChanged(): void {
    this.save();
    const now = performance.now() / 1000;
    if (this.image.frame !== null) this.probes.sample(now, (point) => this.image.value(point), this.convert);
    this.probeStrip.draw(now);
    this.showReadings();
  }

  private moveCursor(dx: number, dy: number): void {
    const size = this.image.size;
    if (size.x === 0) return;
    const from = this.cursor ?? { x: size.x >> 1, y: size.y >> 1 };
    this.cursor = {
      x: Math.min(Math.max(from.x + dx, 0), size.x - 1),
      y: Math.min(Math.max(from.y + dy, 0), size.y - 1),
    };
    this.showReadings();
  }

  // The page itself.

  private redraw(): void {
    this.image.draw();
    this.showReadings();
    this.probeStrip.draw(performance.now() / 1000);
  }

  private relayout(): void {
    this.image.layout();
    this.drawBar();
    this.redraw();
  }

  /** Says so when the image is old. */
  private look(): void {
    const age = (performance.now() - this.frameAt) / 1000;
    const box = element("stale");
    box.hidden = this.frameAt !== 0 && !this.image.blank && (age < STALE_S || this.frozen);
    if (!this.link.connected) box.textContent = "No connection to emitd. Trying again.";
    else if (this.frameAt === 0) box.textContent = "No frame yet.";
    else if (this.image.blank) box.textContent = "The host has switched the sensor off.";
    else box.textContent = `No new frame for ${age.toFixed(0)} s.`;
    const first = this.frames[0];
    const rate = this.frames.length > 1 && age < STALE_S
      ? ((this.frames.length - 1) * 1000) / (this.frames[this.frames.length - 1] - first) : 0;
    element("image-rate").textContent = `${rate.toFixed(1)} images/s`;
  }

  private command(word: string): void {
    if (word === "reset" && performance.now() - this.resetAt > CONFIRM_MS) {
      this.resetAt = performance.now();
      this.toast.show("reset ends the run: press once more to confirm", false);
      return;
    }
    this.resetAt = -Infinity;
    if (this.facts?.may_command) this.link.command(word);
    else this.toast.show("console.commands does not allow commands from here", false);
  }

  private toggleFreeze(): void {
    this.frozen = !this.frozen;
    element("freeze").classList.toggle("on", this.frozen);
    document.body.classList.toggle("frozen", this.frozen);
    if (!this.frozen) this.link.next(this.channel);
  }

  private toggleHelp(): void {
    element("help").hidden = !element("help").hidden;
  }

  private toggleMap(): void {
    this.map = this.map === "thermal" ? "grey" : "thermal";
    this.applyMap();
    this.save();
  }

  private toggleQuantity(): void {
    const was = this.showsKelvins;
    this.kelvins = !this.kelvins;
    if (!this.auto && this.table !== undefined && was !== this.showsKelvins) {
      const change = (value: number) =>
        was ? (this.table as TemperatureTable).radianceAt(value) : (this.table as TemperatureTable).kelvin(value);
      this.low = change(this.low);
      this.high = change(this.high);
    }
    this.quantityChanged();
    this.save();
  }

  private toggleAuto(): void {
    this.setAuto(!this.auto);
  }

  private nextChannel(step: number): void {
    const count = this.facts?.channels.length ?? 0;
    if (count > 0) this.chooseChannel((this.channel + step + count) % count);
  }

  private bind(): void {
    for (const word of COMMANDS) element(word).onclick = () => this.command(word);
    element("freeze").onclick = () => this.toggleFreeze();
    element("quantity").onclick = () => this.toggleQuantity();
    element("map").onclick = () => this.toggleMap();
    element("auto").onclick = () => this.toggleAuto();
    element("help-button").onclick = () => this.toggleHelp();
    element("help").onclick = () => this.toggleHelp();
    element<HTMLSelectElement>("channel").onchange = (event) =>
      this.chooseChannel(Number((event.target as HTMLSelectElement).value));
    element("low").onchange = () => this.typeLimit("low");
    element("high").onchange = () => this.typeLimit("high");
    for (const id of ["low-percent", "high-percent"]) {
      element(id).onchange = () => {
        this.setAuto(true);
      };
    }
    const overlay = element<HTMLCanvasElement>("overlay");
    overlay.onpointermove = (event) => {
      this.cursor = this.image.pixelAt(event.clientX, event.clientY);
      this.showReadings();
    };
    overlay.onpointerdown = (event) => {
      const point = this.image.pixelAt(event.clientX, event.clientY);
      if (point === null || event.button !== 0) return;
      this.cursor = point;
      this.toggleProbe(point);
    };
    overlay.onpointerleave = (event) => {
      // A finger that is lifted leaves the cursor where it was.
      if (event.pointerType === "touch") return;
      this.cursor = null;
      this.showReadings();
    };
    new ResizeObserver(() => this.relayout()).observe(element("picture"));
    const arrow = (name: string, dx: number, dy: number, label: string, help: string) => ({
      keys: [name], label, help,
      run: (event: KeyboardEvent) => this.moveCursor((event.shiftKey ? 10 : 1) * dx, (event.shiftKey ? 10 : 1) * dy),
    });
    bindKeys(
      [
        { keys: ["?"], label: "?", help: "This list", run: () => this.toggleHelp() },
        { keys: ["s"], label: "S", help: "Start", run: () => this.command("start") },
        { keys: ["x"], label: "X", help: "Stop", run: () => this.command("stop") },
        { keys: ["h"], label: "H", help: "Hold: the thermal clock stands still", run: () => this.command("hold") },
        { keys: ["n"], label: "N", help: "Step: one frame while stopped or held", run: () => this.command("step") },
        { keys: ["z"], label: "Z Z", help: "Reset the run (twice within 3 s)", run: () => this.command("reset") },
        { keys: [" ", "f"], label: "Space", help: "Freeze the display, not the run", run: () => this.toggleFreeze() },
        { keys: ["t"], label: "T", help: "Temperature or radiance", run: () => this.toggleQuantity() },
        { keys: ["m"], label: "M", help: "Colour map", run: () => this.toggleMap() },
        { keys: ["r"], label: "R", help: "Limits by percentile or of the host, or keep them", run: () => this.toggleAuto() },
        { keys: ["-"], label: "-  =", help: "Lower limit down, up", run: () => this.moveLimit("low", -1) },
        { keys: ["="], label: "", help: "", run: () => this.moveLimit("low", 1) },
        { keys: [","], label: ",  .", help: "Upper limit down, up", run: () => this.moveLimit("high", -1) },
        { keys: ["."], label: "", help: "", run: () => this.moveLimit("high", 1) },
        { keys: ["j"], label: "J  K", help: "Next, previous channel", run: () => this.nextChannel(1) },
        { keys: ["k"], label: "", help: "", run: () => this.nextChannel(-1) },
        { keys: ["a"], label: "A", help: "Next axis of the motion simulator", run: () => this.axes.next() },
        arrow("ArrowLeft", -1, 0, "Arrows", "Move the cursor by a pixel, with Shift by ten"),
        arrow("ArrowRight", 1, 0, "", ""),
        arrow("ArrowUp", 0, -1, "", ""),
        arrow("ArrowDown", 0, 1, "", ""),
        { keys: ["Enter", "p"], label: "Enter", help: "Put a probe at the cursor, or take it away",
          run: () => { if (this.cursor !== null) this.toggleProbe(this.cursor); } },
        { keys: ["Delete", "Backspace"], label: "Del", help: "Take away the last probe",
          run: () => { this.probes.takeAwayLast(); this.probesChanged(); } },
        { keys: ["Escape"], label: "Esc", help: "Close this list", run: () => { element("help").hidden = true; } },
      ],
      element("help-keys"),
    );
  }

  // Probes and choices outlive a reload.

  private save(): void {
    localStorage.setItem("emit-console", JSON.stringify({
      probes: this.probes.places, channel: this.channel, kelvins: this.kelvins, map: this.map,
    }));
  }

  private restore(): void {
    const text = localStorage.getItem("emit-console");
    if (text === null) return;
    try {
      const saved = JSON.parse(text) as { probes: (Point | null)[]; channel: number; kelvins: boolean; map: string };
      saved.probes.slice(0, MAX_PROBES).forEach((place, i) => {
        this.probes.places[i] = place;
      });
      this.channel = saved.channel;
      this.kelvins = saved.kelvins;
      this.map = saved.map;
    } catch {
      localStorage.removeItem("emit-console");
    }
  }
}

new Console();
