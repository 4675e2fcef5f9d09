// SPDX-License-Identifier: Apache-2.0
// Keys: one table makes both what they do and the help that lists them.

export interface Key {
  /** Names of KeyboardEvent.key; letters match in either case. */
  keys: string[];
  label: string;
  help: string;
  run(event: KeyboardEvent): void;
}

export function bindKeys(keys: readonly Key[], help: HTMLElement): void {
  const table = document.createElement("table");
  for (const key of keys) {
    if (key.help === "") continue; // the row before tells it, too
    const row = table.insertRow();
    const label = document.createElement("kbd");
    label.textContent = key.label;
    row.insertCell().append(label);
    row.insertCell().textContent = key.help;
  }
  help.append(table);
  document.addEventListener("keydown", (event) => {
    const target = event.target as HTMLElement;
    if (target.tagName === "INPUT" || target.tagName === "SELECT") {
      if (event.key === "Escape" || event.key === "Enter") target.blur();
      return;
    }
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const name = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    const key = keys.find((one) => one.keys.includes(name));
    if (key === undefined) return;
    // A focused button must not take the key as a press, too.
    event.preventDefault();
    key.run(event);
  });
}
