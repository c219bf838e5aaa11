// The control protocol (JSON-RPC 2.0) by a WebSocket that is opened again when it is lost.
export class Link extends EventTarget {
  #socket = null;
  #calls = new Map();
  #id = 0;
  #pause_ms = 500;

  open() {
    const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/api`);
    this.#socket = socket;
    socket.onopen = () => {
      this.#pause_ms = 500;
      this.dispatchEvent(new Event("open"));
    };
    socket.onmessage = (message) => this.#receive(JSON.parse(message.data));
    socket.onclose = () => {
      for (const {reject} of this.#calls.values()) reject(new Error("the connection is lost"));
      this.#calls.clear();
      this.dispatchEvent(new CustomEvent("lost", {detail: this.#pause_ms}));
      setTimeout(() => this.open(), this.#pause_ms);
      this.#pause_ms = Math.min(2 * this.#pause_ms, 8000);
    };
  }

  // Returns a promise of the result.
  call(method, params = {}) {
    if (this.#socket?.readyState !== WebSocket.OPEN) return Promise.reject(new Error("imud is not connected"));
    const id = ++this.#id;
    this.#socket.send(JSON.stringify({jsonrpc: "2.0", id, method, params}));
    return new Promise((resolve, reject) => this.#calls.set(id, {resolve, reject}));
  }

  #receive(message) {
    if (message.method) return this.dispatchEvent(new CustomEvent(message.method, {detail: message.params}));
    const call = this.#calls.get(message.id);
    this.#calls.delete(message.id);
    if (message.error) call?.reject(new Error(message.error.data ?? message.error.message));
    else call?.resolve(message.result);
  }
}
