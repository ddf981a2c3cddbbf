// The time that a report shows: seeking, and playing with a speed.

export const SPEEDS = [1, 2, 5, 10, 20, 50];

export class Playback {
  constructor(begin, end) {
    Object.assign(this, { begin, end, t: begin, speed: 5, playing: false, listeners: new Set() });
  }

  seek(t) {
    this.t = Math.min(this.end, Math.max(this.begin, t));
    this.tell();
  }

  toggle() {
    if (this.playing) this.pause();
    else this.play();
  }

  play() {
    if (this.t >= this.end) this.t = this.begin;
    this.playing = true;
    this.last = performance.now();
    requestAnimationFrame((now) => this.step(now));
    this.tell();
  }

  pause() {
    this.playing = false;
    this.tell();
  }

  // A hidden tab gets no pictures for a while; what passed meanwhile must not be jumped over.
  step(now) {
    if (!this.playing) return;
    const passed = Math.max(0, Math.min(0.25, (now - this.last) / 1000));
    this.last = now;
    this.t = Math.min(this.end, this.t + passed * this.speed);
    if (this.t >= this.end) this.playing = false;
    else requestAnimationFrame((next) => this.step(next));
    this.tell();
  }

  tell() {
    for (const listener of this.listeners) listener();
  }
}
