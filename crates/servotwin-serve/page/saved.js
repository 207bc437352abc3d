"use strict";
// Stands in for the feed of a server in a page that holds its session. It describes the flight and plays the messages of
// the session. Nothing leaves the page: both ways to the server are replaced. The block keeps
// these names apart from those of the page.
{
  const SHOWN_AFTER_A_JUMP = 1200;
  const SHOWN_EVENTS = 10000;
  const TICK_MS = 20;

  /** The bytes of the session: base64 of gzip, in an element that a browser does not run. */
  function unpacked() {
    const text = atob(document.getElementById("session").textContent);
    const packed = new Uint8Array(text.length);
    for (let k = 0; k < text.length; k++) packed[k] = text.charCodeAt(k);
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new Response(stream).arrayBuffer();
  }

  /** The bits of all values sample by sample, of bytes that hold them signal by signal. */
  function valuesOf(bytes, width) {
    const words = new Uint32Array(bytes);
    const samples = words.length / width;
    const bits = new Uint32Array(words.length);
    for (let signal = 0; signal < width; signal++) {
      for (let k = 0; k < samples; k++) bits[k * width + signal] = words[signal * samples + k];
    }
    return bits;
  }

  /** A session: what the flight is, its frames, and the events and states before each of them. */
  class SavedSession {
    constructor(buffer) {
      const length = new DataView(buffer).getUint32(0, true);
      const { about, frames, texts } = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
      this.about = about;
      this.width = about.signals.length;
      this.values = valuesOf(buffer.slice(4 + length), this.width);
      this.messages = [];
      let first = 0, text = 0;
      frames.forEach((count, frame) => {
        while (text < texts.length && texts[text][0] <= frame) this.messages.push({ text: texts[text++][1], count: 0 });
        this.messages.push({ first, count });
        first += count;
      });
      while (text < texts.length) this.messages.push({ text: texts[text++][1], count: 0 });
      this.durationS = first * about.period_s;
    }

    /** What the server would send for a message: text, or the bytes of a frame. */
    sent({ text, first, count }) {
      if (count === 0) return text;
      const buffer = new ArrayBuffer(16 + 4 * count * this.width);
      const view = new DataView(buffer);
      view.setBigUint64(0, BigInt(first), true);
      view.setUint32(8, count, true);
      view.setUint32(12, this.width, true);
      new Uint32Array(buffer, 16).set(this.values.subarray(first * this.width, (first + count) * this.width));
      return buffer;
    }
  }

  const savedSession = unpacked().then((buffer) => new SavedSession(buffer));

  globalThis.fetch = async (path) => {
    if (!path.startsWith("about")) throw new Error("a saved page has no server");
    const { about } = await savedSession;
    return { ok: true, json: async () => about };
  };

  /** The WebSocket of the page: plays the session with speed, pause and jump. */
  globalThis.WebSocket = class SavedPlayer {
    static OPEN = 1;

    constructor() {
      this.readyState = SavedPlayer.OPEN;
      this.at = 0;
      this.dueS = 0;
      this.speed = 1;
      this.isPaused = false;
      savedSession.then((session) => {
        this.session = session;
        this.onopen();
        this.restart();
        this.lastMs = performance.now();
        setInterval(() => this.play(), TICK_MS);
      });
    }

    say(content) { this.onmessage({ data: JSON.stringify(content) }); }

    tell(refused = null) {
      const duration_s = this.session.durationS;
      this.say({ playback: { speed: this.speed, is_paused: this.isPaused, duration_s, refused } });
    }

    /** Carries out a request of the page. */
    send(words) {
      const { speed, pause, jump, restart } = JSON.parse(words);
      let refused = null;
      if (speed !== undefined) this.speed = speed;
      else if (pause !== undefined) this.isPaused = pause;
      else if (jump !== undefined) this.jump(jump);
      else if (restart !== undefined) this.jump(0);
      else refused = "a replay takes no faults";
      this.tell(refused);
    }

    restart() {
      this.jump(0);
      this.tell();
    }

    /** Shows what was before a time, s, and goes on from there. */
    jump(timeS) {
      const { messages, about } = this.session;
      let endS = 0;
      this.at = messages.findIndex(({ count }) => (endS += count * about.period_s) > timeS + 1e-9);
      if (this.at < 0) this.at = messages.length;
      this.dueS = 0;
      const before = messages.slice(0, this.at);
      const texts = before.filter(({ count }) => count === 0).map(({ text }) => JSON.parse(text));
      const events = texts.filter(({ event }) => event).map(({ event }) => event).slice(-SHOWN_EVENTS);
      const state = texts.findLast((one) => one.state !== undefined)?.state ?? null;
      this.say({ events, state });
      before.filter(({ count }) => count).slice(-SHOWN_AFTER_A_JUMP).forEach((one) => this.onmessage({ data: this.session.sent(one) }));
    }

    /** Sends what is due since the last tick. */
    play() {
      const now = performance.now();
      if (!this.isPaused) this.dueS += (now - this.lastMs) / 1000 * this.speed;
      this.lastMs = now;
      const { messages, about } = this.session;
      while (!this.isPaused && this.at < messages.length && this.dueS >= 0) {
        const message = messages[this.at++];
        this.dueS -= message.count * about.period_s;
        this.onmessage({ data: this.session.sent(message) });
      }
      if (this.at === messages.length) this.dueS = 0;
    }
  };
}
