// One WebGL renderer for the whole page: each view is a plain 2-D canvas that gets a copy of its picture.
// Browsers allow few WebGL contexts; this way there is one, and nothing is drawn that is hidden or unchanged.

import { SRGBColorSpace, PCFShadowMap, WebGLRenderer } from "three";

/** The page's renderer, or null where the browser has no WebGL 2. */
export function createStage() {
  const coarse = drawsOnProcessor();
  const canvas = document.createElement("canvas");
  const context = canvas.getContext("webgl2", { antialias: !coarse, alpha: true, powerPreference: "low-power" });
  return context ? new Stage(canvas, context, coarse) : null;
}

/** Whether pictures are computed by the processor, for want of a graphics card: then smooth edges cost more than they show. */
function drawsOnProcessor() {
  const context = document.createElement("canvas").getContext("webgl2");
  const named = context?.getExtension("WEBGL_debug_renderer_info");
  const name = context?.getParameter(named?.UNMASKED_RENDERER_WEBGL ?? context.RENDERER) ?? "";
  context?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}

/** A view: a canvas, what it shows, and when it must be drawn again. */
class View {
  constructor(canvas, draw) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.draw = draw;
    this.visible = false;
    this.dirty = true;
    this.running = null;
    this.quality = 1;
  }

  /** Asks for one new picture. */
  invalidate() { this.dirty = true; this.wake?.(); }

  /** Calls `tick(seconds since the last)` on every frame while it returns true and the view is in sight. */
  animate(tick) { this.running = tick; this.wake?.(); }
}

class Stage {
  constructor(canvas, context, coarse) {
    this.coarse = coarse;
    this.renderer = new WebGLRenderer({ canvas, context, alpha: true });
    this.renderer.outputColorSpace = SRGBColorSpace;
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = PCFShadowMap;
    this.renderer.setPixelRatio(1);
    this.renderer.setScissorTest(true);
    this.views = [];
    this.size = [0, 0];
    this.pending = 0;
    this.started = false;
    this.frames = 0;
    canvas.addEventListener("webglcontextrestored", () => this.views.forEach((view) => view.invalidate()));
    this.seen = new IntersectionObserver((entries) => {
      for (const entry of entries) {
        const view = this.views.find((candidate) => candidate.canvas === entry.target);
        if (view) view.visible = entry.isIntersecting;
      }
      this.wake();
    }, { rootMargin: "80px" });
    this.resized = new ResizeObserver((entries) => {
      for (const entry of entries) this.views.find((view) => view.canvas === entry.target)?.invalidate();
    });
  }

  /** Adds a view; `draw()` returns the scene and camera to show. */
  add(canvas, draw) {
    const view = new View(canvas, draw);
    view.wake = () => this.wake();
    this.views.push(view);
    this.seen.observe(canvas);
    this.resized.observe(canvas);
    return view;
  }

  /** Begins to draw. */
  start() { this.started = true; this.wake(); }

  wake() {
    if (this.started && !this.pending) this.pending = requestAnimationFrame((now) => this.frame(now));
  }

  frame(now) {
    this.pending = 0;
    const elapsed = Math.min(0.3, (now - (this.before ?? now)) / 1000);
    let more = false;
    for (const view of this.views) {
      if (!view.visible) continue;
      if (view.running) {
        if (view.running(elapsed)) more = true;
        else view.running = null;
        this.adapt(view, elapsed);
        view.dirty = true;
      }
      if (view.dirty) this.paint(view);
    }
    this.before = more ? now : undefined;
    if (more) this.wake();
  }

  /** A machine without a graphics card draws moving pictures coarser than still ones. */
  adapt(view, elapsed) {
    if (!view.running) view.quality = 1;
    else if (elapsed > 0.045) view.quality = Math.max(0.5, view.quality - 0.1);
    else if (elapsed > 0 && elapsed < 0.018) view.quality = Math.min(1, view.quality + 0.01);
  }

  paint(view) {
    const { canvas, context } = view;
    const ratio = view.quality * Math.min(2, window.devicePixelRatio || 1);
    const width = Math.round(canvas.clientWidth * ratio);
    const height = Math.round(canvas.clientHeight * ratio);
    if (!width || !height) return;
    view.dirty = false;
    if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
    if (width > this.size[0] || height > this.size[1]) {
      this.size = [Math.max(width, this.size[0]), Math.max(height, this.size[1])];
      this.renderer.setSize(...this.size, false);
    }
    const { scene, camera } = view.draw(height);
    camera.aspect = width / height;
    camera.updateProjectionMatrix();
    this.renderer.setViewport(0, 0, width, height);
    this.renderer.setScissor(0, 0, width, height);
    this.renderer.setClearColor(0xffffff, 0);
    this.renderer.clear();
    this.renderer.render(scene, camera);
    context.clearRect(0, 0, width, height);
    context.drawImage(this.renderer.domElement, 0, this.size[1] - height, width, height, 0, 0, width, height);
    this.frames += 1;
    canvas.dataset.painted = String(Number(canvas.dataset.painted ?? 0) + 1);
  }
}

/** The line shown where a three-dimensional view cannot be. */
export const NO_WEBGL = "This view needs WebGL 2, which this browser does not offer or has switched off. All tables and charts work without it.";
