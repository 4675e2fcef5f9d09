// SPDX-License-Identifier: Apache-2.0
// The panels beside the image: clients, counters, warnings, channels.

import { Answer, Channel, Hello, Status } from "./link.js";

export function element<T extends HTMLElement>(id: string): T {
  const found = document.getElementById(id);
  if (found === null) throw new Error(`the page has no #${id}`);
  return found as T;
}

/** Counters that grow when something was not right. */
const FAULTS = new RegExp(
  [
    "refused", "drop", "lost", "late", "missed", "missing", "skipped", "repeated", "stale", "errors?$", "failed", "failures",
    "faults?$", "disconnected_slow", "no_free_slot", "bad_mac", "unknown_", "torn", "unauthenticated", "replayed",
    "without_image", "clamped", "steps$", "old_run", "over_rate", "silences", "interlocks", "ignored", "jumps", "suppressed",
    "unused", "extrapolated", "frames_shed", "coarse",
  ].join("|"),
);

export function fillTable(table: HTMLTableElement, rows: (string | { text: string; kind: string })[][]): void {
  const body = table.tBodies[0];
  while (body.rows.length > rows.length) body.deleteRow(-1);
  rows.forEach((cells, i) => {
    const row = body.rows[i] ?? body.insertRow();
    while (row.cells.length > cells.length) row.deleteCell(-1);
    cells.forEach((cell, k) => {
      const box = row.cells[k] ?? row.insertCell();
      const text = typeof cell === "string" ? cell : cell.text;
      const kind = typeof cell === "string" ? "" : cell.kind;
      if (box.textContent !== text) box.textContent = text;
      if (box.className !== kind) box.className = kind;
    });
  });
}

function count(value: number): string {
  return value.toLocaleString("en-US").replace(/,/g, "\u2009");
}

export function ms(us: number | undefined): string {
  return us === undefined ? "" : (us / 1000).toFixed(us < 10000 ? 3 : 1);
}

export function duration(seconds: number): string {
  const s = Math.floor(seconds);
  const two = (value: number) => String(value).padStart(2, "0");
  return `${Math.floor(s / 3600)}:${two(Math.floor(s / 60) % 60)}:${two(s % 60)}`;
}

export function channelName(channel: Channel): string {
  const name = channel.name || channel.kind;
  return channel.band === "" || channel.band === name ? name : `${name} ${channel.band}`;
}

export class Panels {
  private labels = new Map<string, string>();
  private earlier = new Map<string, { value: number; atS: number }>();

  hello(hello: Hello): void {
    this.labels = new Map(hello.counters);
    this.earlier.clear();
    fillTable(
      element<HTMLTableElement>("channels"),
      hello.channels.map((channel) => [
        String(channel.index),
        channelName(channel),
        channel.sensor,
        `${channel.width_px}\u00d7${channel.height_px}`,
        channel.lo_um > 0 ? `${channel.lo_um}\u2013${channel.hi_um} \u00b5m` : "",
        channel.every_nth === 1 ? "every frame" : `every ${channel.every_nth}th`,
        channel.quantity,
      ]),
    );
  }

  status(status: Status): void {
    fillTable(
      element<HTMLTableElement>("clients"),
      status.clients.map((client) => [
        client.peer,
        client.role,
        client.channel,
        client.transport,
        client.role === "client" && client.frames !== undefined ? count(client.frames) : "",
        client.role !== "client" || client.skipped === undefined
          ? ""
          : { text: count(client.skipped), kind: client.skipped > 0 ? "bad" : "" },
        client.role === "client" ? ms(client.delay_us) : "",
        client.role === "client" ? ms(client.jitter_us) : "",
      ]),
    );
    element("client-count").textContent = String(status.clients.length);
    this.faults(status);
    fillTable(
      element<HTMLTableElement>("warnings"),
      status.warnings.map((warning) => [
        { text: warning.level, kind: warning.level === "error" ? "bad" : "warn" },
        count(warning.count),
        `${warning.age_s < 90 ? `${warning.age_s.toFixed(0)} s` : duration(warning.age_s)} ago`,
        warning.text,
      ]),
    );
    fillTable(
      element<HTMLTableElement>("agents"),
      status.agents.map((agent) => [agent.name, ms(agent.max_us), count(agent.over), agent.busy_s.toFixed(1)]),
    );
  }

  private faults(status: Status): void {
    const rows: { name: string; value: number; changedS: number }[] = [];
    for (const [name, value] of Object.entries(status.counters)) {
      const before = this.earlier.get(name);
      if (before === undefined || before.value !== value) {
        this.earlier.set(name, { value, atS: before === undefined ? -Infinity : status.uptime_s });
      }
      if (FAULTS.test(name)) {
        rows.push({ name, value, changedS: (this.earlier.get(name) as { atS: number }).atS });
      }
    }
    rows.sort((a, b) => b.changedS - a.changedS || (a.name < b.name ? -1 : 1));
    fillTable(
      element<HTMLTableElement>("faults"),
      rows.map((row) => {
        const fresh = status.uptime_s - row.changedS < 5;
        return [
          { text: count(row.value), kind: fresh ? "bad" : "" },
          row.name.replace(/_/g, " "),
          this.labels.get(row.name) ?? "",
        ];
      }),
    );
    const fresh = rows.filter((row) => status.uptime_s - row.changedS < 5).length;
    const badge = element("fault-count");
    badge.textContent = fresh > 0 ? `${fresh} growing` : "";
    badge.className = fresh > 0 ? "badge bad" : "badge";
  }
}

/** Says what became of a command, for some seconds. */
export class Toast {
  private timer = 0;

  show(text: string, good: boolean): void {
    const box = element("toast");
    box.textContent = text;
    box.className = good ? "good" : "bad";
    box.hidden = false;
    window.clearTimeout(this.timer);
    this.timer = window.setTimeout(() => {
      box.hidden = true;
    }, 4000);
  }

  answer(answer: Answer): void {
    const text = answer.command === "replay" ? answer.text : `${answer.command}: ${answer.ok ? "done" : answer.text}`;
    this.show(text, answer.ok);
  }
}
