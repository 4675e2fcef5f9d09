// SPDX-License-Identifier: Apache-2.0
// The keys of the page.

import { AxesPanel } from "./axes.js";
import { element } from "./display.js";
import { ExplainPanel } from "./explain.js";
import { Key } from "./keys.js";
import { ReplayBar } from "./replay.js";

/** What keys do to the page. */
export interface Keyed {
  readonly axes: AxesPanel;
  readonly explain: ExplainPanel;
  readonly replay: ReplayBar;
  command(word: string): void;
  toggleHelp(): void;
  toggleFreeze(): void;
  toggleQuantity(): void;
  toggleMap(): void;
  toggleAuto(): void;
  moveLimit(which: "low" | "high", steps: number): void;
  nextChannel(step: number): void;
  moveCursor(dx: number, dy: number): void;
  toggleProbeAtCursor(): void;
  takeAwayProbe(): void;
  nextProbe(): void;
}

export function keyTable(page: Keyed): Key[] {
  const arrow = (name: string, dx: number, dy: number, label: string, help: string) => ({
    keys: [name], label, help,
    run: (event: KeyboardEvent) => page.moveCursor((event.shiftKey ? 10 : 1) * dx, (event.shiftKey ? 10 : 1) * dy),
  });
  return [
    { keys: ["?"], label: "?", help: "This list", run: () => page.toggleHelp() },
    { keys: ["s"], label: "S", help: "Start", run: () => page.command("start") },
    { keys: ["x"], label: "X", help: "Stop", run: () => page.command("stop") },
    { keys: ["h"], label: "H", help: "Hold: the thermal clock stands still", run: () => page.command("hold") },
    { keys: ["n"], label: "N", help: "Step: one frame while stopped or held", run: () => page.command("step") },
    { keys: ["z"], label: "Z Z", help: "Reset the run (twice within 3 s)", run: () => page.command("reset") },
    { keys: [" ", "f"], label: "Space", help: "Freeze the display, not the run", run: () => page.toggleFreeze() },
    { keys: ["t"], label: "T", help: "Temperature or radiance", run: () => page.toggleQuantity() },
    { keys: ["m"], label: "M", help: "Colour map", run: () => page.toggleMap() },
    { keys: ["r"], label: "R", help: "Limits by percentile or of the host, or keep them", run: () => page.toggleAuto() },
    { keys: ["-"], label: "-  =", help: "Lower limit down, up", run: () => page.moveLimit("low", -1) },
    { keys: ["="], label: "", help: "", run: () => page.moveLimit("low", 1) },
    { keys: [","], label: ",  .", help: "Upper limit down, up", run: () => page.moveLimit("high", -1) },
    { keys: ["."], label: "", help: "", run: () => page.moveLimit("high", 1) },
    { keys: ["j"], label: "J  K", help: "Next, previous channel", run: () => page.nextChannel(1) },
    { keys: ["k"], label: "", help: "", run: () => page.nextChannel(-1) },
    { keys: ["a"], label: "A", help: "Next axis of the motion simulator", run: () => page.axes.next() },
    arrow("ArrowLeft", -1, 0, "Arrows", "Move the cursor by a pixel, with Shift by ten"),
    arrow("ArrowRight", 1, 0, "", ""),
    arrow("ArrowUp", 0, -1, "", ""),
    arrow("ArrowDown", 0, 1, "", ""),
    { keys: ["Enter", "p"], label: "Enter", help: "Put a probe at the cursor, or take it away",
      run: () => { page.toggleProbeAtCursor(); } },
    { keys: ["Delete", "Backspace"], label: "Del", help: "Take away the chosen probe, or the last one",
      run: () => page.takeAwayProbe() },
    { keys: ["e"], label: "E", help: "Choose the next probe: how its surface came to its temperature",
      run: () => page.nextProbe() },
    { keys: ["["], label: "[  ]", help: "Replay: a second back, on; with Shift ten",
      run: () => page.replay.seekBy(-1) },
    { keys: ["]"], label: "", help: "", run: () => page.replay.seekBy(1) },
    { keys: ["{"], label: "", help: "", run: () => page.replay.seekBy(-10) },
    { keys: ["}"], label: "", help: "", run: () => page.replay.seekBy(10) },
    { keys: ["b"], label: "B", help: "Replay: a frame back (N: a frame on)", run: () => page.replay.move(-1) },
    { keys: ["PageUp"], label: "PgUp  PgDn", help: "Replay: event before, next event",
      run: () => page.replay.seekMark(-1) },
    { keys: ["PageDown"], label: "", help: "", run: () => page.replay.seekMark(1) },
    { keys: ["o"], label: "O", help: "Replay: begin of a loop, then its end, then no loop",
      run: () => page.replay.loop() },
    { keys: ["Escape"], label: "Esc", help: "Close this list, or the history of a probe",
      run: () => {
        if (element("help").hidden) page.explain.close();
        element("help").hidden = true;
      } },
  ];
}
