// SPDX-License-Identifier: Apache-2.0
// The operator's console: wires image, limits, probes, strips and commands together.

import { AxesPanel } from "./axes.js";
import { drawColorBar } from "./bar.js";
import { colorTable, PROBE_COLORS, reversed } from "./colors.js";
import { channelName, duration, element, Panels, Toast } from "./display.js";
import { ExplainPanel, Explanation } from "./explain.js";
import { ImageView, percentiles, Point } from "./image.js";
import { Keyed, keyTable } from "./key_table.js";
import { bindKeys } from "./keys.js";
import { Answer, Frame, Hello, Link, Picture, Status } from "./link.js";
import { PacePanel } from "./pace.js";
import { MAX_PROBES, Probes } from "./probes.js";
import { ReplayBar } from "./replay.js";
import { Strip } from "./strips.js";
import { fetchTable, TemperatureTable } from "./temperature.js";

const COMMANDS = ["start", "stop", "hold", "step", "reset"];
const AUTO_PERIOD_MS = 500;
const PROBE_SECONDS = 60;
const STALE_S = 2;
/** A reset is asked for twice within this time. */
const CONFIRM_MS = 3000;

class Console implements Keyed {
  private readonly image = new ImageView(element("image"), element("overlay"));
  private readonly panels = new Panels();
  readonly axes = new AxesPanel();
  private readonly pace = new PacePanel();
  private readonly toast = new Toast();
  private readonly probes = new Probes();
  readonly explain = new ExplainPanel(() => this.explainChanged());
  readonly replay = new ReplayBar(() => this.link, (text) => this.toast.show(text, true));
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
  private readonly probeStrip: Strip;

  constructor() {
    this.probeStrip = new Strip(element("probe-strip"), this.probes.shown, {
      seconds: PROBE_SECONDS, fromZero: false, unit: "", dots: false,
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
    this.explain.hello(hello.no_explanation);
    this.replay.hello(hello.recording);
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
    pill.textContent = status.ready ? (this.replay.status(status.replay) ?? state) : "not ready";
    pill.className = `pill ${status.ready ? state : "stopped"}`;
    element("start").classList.toggle("on", state === "running");
    element("stop").classList.toggle("on", state === "stopped");
    element("hold").classList.toggle("on", state === "held");
    element("uptime").textContent = `up ${duration(status.uptime_s)}`;
    if (status.run_id !== this.runId) {
      this.runId = status.run_id;
      this.pace.clear();
    }
    this.pace.take(status);
  }

  answer(answer: Answer): void {
    if (answer.command === "explain") this.explain.refuse(answer.text);
    else this.toast.answer(answer);
  }

  explanation(explanation: Explanation): void {
    this.explain.take(explanation);
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

  moveLimit(which: "low" | "high", steps: number): void {
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
    drawColorBar(element("bar"), this.colors, this.low, this.high);
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
      item.title = "Press to see how the surface came to its temperature";
      item.onclick = () => this.chooseProbe(index);
      item.style.color = PROBE_COLORS[index];
      list.append(item);
    }
    texts.forEach((text, i) => {
      const item = list.children[i] as HTMLElement;
      item.hidden = text === "";
      item.classList.toggle("on", i === this.explain.chosen);
      item.textContent = `${i + 1}  ${text}`;
    });
    element("probe-hint").hidden = texts.some((text) => text !== "");
    element("probe-unit").textContent = this.unit;
    this.image.drawOverlay(this.probes.places, this.cursor);
  }

  private toggleProbe(point: Point): void {
    const reach = Math.max(3, this.image.size.x / 80);
    const taken = this.probes.takeAwayAt(point, reach);
    const put = taken < 0 ? this.probes.put(point) : -1;
    if (taken >= 0) this.explain.forget(taken);
    else if (put < 0) this.toast.show(`there are at most ${MAX_PROBES} probes`, false);
    this.probesChanged();
    if (put >= 0 && this.facts?.no_explanation === "") this.chooseProbe(put);
  }

  /** Shows how the surface under a probe came to its temperature; of the chosen one, as of now. */
  private chooseProbe(index: number): void {
    const place = this.probes.places[index];
    if (place === null) return;
    if (index === this.explain.chosen) this.explain.again(place, this.channel, this.image.frame, this.link);
    else this.explain.choose(index, place, this.channel, this.image.frame, this.link);
  }

  nextProbe(): void {
    const count = this.probes.places.length;
    for (let i = 1; i <= count; ++i) {
      const index = (this.explain.chosen + i + count) % count;
      if (this.probes.places[index] !== null) {
        this.chooseProbe(index);
        return;
      }
    }
    this.toast.show("put a probe first", false);
  }

  takeAwayProbe(): void {
    const taken = this.explain.chosen >= 0 ? this.explain.chosen : this.probes.last();
    if (taken < 0) return;
    this.probes.takeAway(taken);
    this.explain.forget(taken);
    this.probesChanged();
  }

  private explainChanged(): void {
    this.explain.draw(this.facts?.channels ?? []);
    if (this.image.frame !== null) this.showReadings();
  }

  toggleProbeAtCursor(): void {
    if (this.cursor !== null) this.toggleProbe(this.cursor);
  }

  private probesChanged(): void {
    this.save();
    const now = performance.now() / 1000;
    if (this.image.frame !== null) this.probes.sample(now, (point) => this.image.value(point), this.convert);
    this.probeStrip.draw(now);
    this.showReadings();
  }

  moveCursor(dx: number, dy: number): void {
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
    this.explain.draw(this.facts?.channels ?? []);
  }

  /** Says so when the image is old. */
  private look(): void {
    this.explain.tick();
    const age = (performance.now() - this.frameAt) / 1000;
    const box = element("stale");
    const waits = this.frozen || (this.replay.active && this.replay.state?.playing === false);
    box.hidden = this.frameAt !== 0 && !this.image.blank && (age < STALE_S || waits);
    if (!this.link.connected) box.textContent = "No connection to emitd. Trying again.";
    else if (this.frameAt === 0) box.textContent = "No frame yet.";
    else if (this.image.blank) box.textContent = "The host has switched the sensor off.";
    else box.textContent = `No new frame for ${age.toFixed(0)} s.`;
    const first = this.frames[0];
    const rate = this.frames.length > 1 && age < STALE_S
      ? ((this.frames.length - 1) * 1000) / (this.frames[this.frames.length - 1] - first) : 0;
    element("image-rate").textContent = `${rate.toFixed(1)} images/s`;
  }

  command(word: string): void {
    if (word === "reset" && performance.now() - this.resetAt > CONFIRM_MS) {
      this.resetAt = performance.now();
      this.toast.show("reset ends the run: press once more to confirm", false);
      return;
    }
    this.resetAt = -Infinity;
    if (this.facts?.may_command) this.link.command(word);
    else this.toast.show("console.commands does not allow commands from here", false);
  }

  toggleFreeze(): void {
    this.frozen = !this.frozen;
    element("freeze").classList.toggle("on", this.frozen);
    document.body.classList.toggle("frozen", this.frozen);
    if (!this.frozen) this.link.next(this.channel);
  }

  toggleHelp(): void {
    element("help").hidden = !element("help").hidden;
  }

  toggleMap(): void {
    this.map = this.map === "thermal" ? "grey" : "thermal";
    this.applyMap();
    this.save();
  }

  toggleQuantity(): void {
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

  toggleAuto(): void {
    this.setAuto(!this.auto);
  }

  nextChannel(step: number): void {
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
    bindKeys(keyTable(this), element("help-keys"));
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
