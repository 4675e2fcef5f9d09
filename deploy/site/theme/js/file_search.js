// SPDX-License-Identifier: Apache-2.0
// Search of a site that is opened from a folder (file://). There a browser refuses to fetch the index and to start a
// worker. The index comes as a script, and the worker's script runs in a frame of its own.
// The theme takes `__search.index` in place of the index that it would fetch.
var __search;
if (location.protocol === "file:") {
  const base = new URL("..", document.currentScript.src);

  __search = {
    index: new Promise((resolve, reject) => {
      const script = document.createElement("script");
      script.src = new URL("search/search_index.js", base).href;
      script.onload = () => resolve(window.__search_index);
      script.onerror = reject;
      document.head.append(script);
    }),
  };

  window.Worker = class extends EventTarget {
    constructor(url) {
      super();
      this.ready = new Promise((resolve) => {
        const frame = document.createElement("iframe");
        frame.hidden = true;
        frame.srcdoc = "<!doctype html>";
        frame.onload = () => {
          const inside = frame.contentWindow;
          inside.postMessage = (data) => this.dispatchEvent(new MessageEvent("message", { data }));
          inside.importScripts = () => undefined; // English needs no further scripts
          const script = inside.document.createElement("script");
          script.src = url;
          script.onload = () => resolve(inside);
          inside.document.body.append(script);
        };
        document.body.append(frame);
      });
    }
    postMessage(data) {
      this.ready.then((inside) => inside.dispatchEvent(new inside.MessageEvent("message", { data })));
    }
    terminate() {}
  };
}
