// A page that was opened as a file may start no worker, and the search is one. There its script runs
// in a hidden frame, with the two ends of its messages joined by hand. The name keeps the plugin
// `offline` from fetching a package of that name from elsewhere.
if (location.protocol === "file:") {
  window.Worker = class extends EventTarget {
    constructor(url) {
      super();
      const frame = document.createElement("iframe");
      frame.hidden = true;
      document.body.append(frame);
      const inside = frame.contentWindow;
      inside.postMessage = (data) => this.dispatchEvent(new MessageEvent("message", { data }));
      inside.importScripts = () => {};
      this.inside = new Promise((ready) => {
        const script = frame.contentDocument.createElement("script");
        script.src = url;
        script.onload = () => ready(inside);
        frame.contentDocument.body.append(script);
      });
    }
    postMessage(data) {
      this.inside.then((inside) => inside.dispatchEvent(new MessageEvent("message", { data })));
    }
    terminate() {}
  };
}
