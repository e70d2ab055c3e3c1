// An orbiting camera that several views can share: mouse, touch, wheel and arrow keys. World z is up.

import { Vector3 } from "three";
import { calm } from "./dom.js";

const TOP = (Math.PI / 2) * 0.999;
const clamp = (value, low, high) => Math.min(high, Math.max(low, value));

export class Orbit {
  /** `target` (m), `distance` (m), `azimuth` from +x and `elevation` (rad) of the first view. */
  constructor(start) {
    this.start = { ...start, target: start.target.clone() };
    Object.assign(this, { ...this.start, target: start.target.clone() });
    this.listeners = [];
    this.flight = 0;
  }

  onChange(listener) { this.listeners.push(listener); }

  changed() { for (const listener of this.listeners) listener(); }

  /** Puts a camera where the orbit is. */
  apply(camera) {
    const { target, distance, azimuth, elevation } = this;
    const flat = distance * Math.cos(elevation);
    camera.up.set(0, 0, 1);
    camera.position.set(target.x + flat * Math.cos(azimuth), target.y + flat * Math.sin(azimuth), target.z + distance * Math.sin(elevation));
    camera.near = distance / 50;
    camera.far = distance * 20;
    camera.lookAt(target);
  }

  turn(right, up) {
    cancelAnimationFrame(this.flight);
    this.azimuth -= right;
    this.elevation = clamp(this.elevation + up, -0.15, TOP);
    this.changed();
  }

  zoom(factor) {
    cancelAnimationFrame(this.flight);
    this.distance = clamp(this.distance * factor, this.start.distance / 12, this.start.distance * 4);
    this.changed();
  }

  /** Moves the target in the picture plane; `right` and `up` in parts of the picture's height. */
  pan(right, up) {
    cancelAnimationFrame(this.flight);
    const { azimuth: a, elevation: e, distance } = this;
    const size = 0.6 * distance;
    this.target.addScaledVector(new Vector3(-Math.sin(a), Math.cos(a), 0), -right * size);
    this.target.addScaledVector(new Vector3(-Math.cos(a) * Math.sin(e), -Math.sin(a) * Math.sin(e), Math.cos(e)), up * size);
    this.changed();
  }

  /** Glides to a view (at once for readers who want calm). */
  fly(goal) {
    cancelAnimationFrame(this.flight);
    const from = { azimuth: this.azimuth, elevation: this.elevation, distance: this.distance, target: this.target.clone() };
    const to = { ...from, ...goal };
    // The short way round.
    to.azimuth = from.azimuth + Math.atan2(Math.sin(to.azimuth - from.azimuth), Math.cos(to.azimuth - from.azimuth));
    const began = performance.now();
    const step = (now) => {
      const s = calm() ? 1 : clamp((now - began) / 450, 0, 1);
      const eased = s * s * (3 - 2 * s);
      for (const name of ["azimuth", "elevation", "distance"]) this[name] = from[name] + (to[name] - from[name]) * eased;
      this.target.lerpVectors(from.target, to.target, eased);
      this.changed();
      if (s < 1) this.flight = requestAnimationFrame(step);
    };
    step(began);
    if (!calm()) this.flight = requestAnimationFrame(step);
  }

  /** Begins anew: `start` is what a reset goes to, `now` where it is. */
  restart(start, now) {
    cancelAnimationFrame(this.flight);
    this.start = { ...start, target: start.target.clone() };
    Object.assign(this, now, { target: now.target.clone() });
    this.changed();
  }

  reset() { this.fly({ ...this.start, target: this.start.target.clone() }); }

  /** Listens to a canvas. The wheel zooms only once the canvas has the focus, so that the page still scrolls. */
  attach(canvas) {
    const pointers = new Map();
    canvas.tabIndex = 0;
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("pointerdown", (event) => {
      canvas.focus({ preventScroll: true });
      canvas.setPointerCapture(event.pointerId);
      pointers.set(event.pointerId, event);
    });
    const release = (event) => pointers.delete(event.pointerId);
    canvas.addEventListener("pointerup", release);
    canvas.addEventListener("pointercancel", release);
    canvas.addEventListener("pointermove", (event) => {
      const before = pointers.get(event.pointerId);
      if (!before) return;
      const [dx, dy] = [event.clientX - before.clientX, event.clientY - before.clientY];
      const height = canvas.clientHeight;
      if (pointers.size === 2) {
        const other = [...pointers.values()].find((pointer) => pointer.pointerId !== event.pointerId);
        const gap = (pointer) => Math.hypot(pointer.clientX - other.clientX, pointer.clientY - other.clientY);
        this.zoom(clamp(gap(before) / Math.max(1, gap(event)), 0.5, 2));
        this.pan(dx / height / 2, dy / height / 2);
      } else if (event.buttons & 2 || event.shiftKey) this.pan(dx / height, dy / height);
      else this.turn((dx / height) * Math.PI, (dy / height) * Math.PI);
      pointers.set(event.pointerId, event);
    });
    canvas.addEventListener("wheel", (event) => {
      if (document.activeElement !== canvas && !event.ctrlKey) return;
      event.preventDefault();
      this.zoom(Math.exp(clamp(event.deltaY, -120, 120) * 0.0022));
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => {
      const turns = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] }[event.key];
      if (turns && event.shiftKey) this.pan(turns[0], -turns[1]);
      else if (turns) this.turn(...turns);
      else if (event.key === "+" || event.key === "=") this.zoom(1 / 1.12);
      else if (event.key === "-") this.zoom(1.12);
      else if (event.key === "0") this.reset();
      else return;
      event.preventDefault();
    });
  }
}
