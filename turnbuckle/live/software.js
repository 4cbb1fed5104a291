// Put into the page before viser's own code. Where the browser draws without a graphics card (SwiftShader, llvmpipe), the
// time of a frame goes with the pixels, so: no smoothing of edges, fewer pixels while something moves (as many as 30 frames
// a second allow), all of them when it stands. With a graphics card it does nothing.
(() => {
  const PIXELS = 80e3, FEWEST = 60e3; // drawn while something moves: at first, at least
  const PACE = 27; // [ms] between two drawings in the mean: more would only take time from the simulation
  const SLOW = 32, FAST = 29; // [ms]: slower and pixels are taken away, faster and some are given back
  const TICK = 300; // [ms]
  const FIXED = new URLSearchParams(window.location.search).has("fixedDpr"); // the user has chosen
  const probe = document.createElement("canvas").getContext("webgl2");
  const told = probe && probe.getExtension("WEBGL_debug_renderer_info");
  const renderer = told ? probe.getParameter(told.UNMASKED_RENDERER_WEBGL) : "";
  probe?.getExtension("WEBGL_lose_context")?.loseContext();
  if (!/swiftshader|llvmpipe|softpipe|software|basic render/i.test(renderer)) return;
  const state = (window.turnbuckleSoftware = { renderer, moving: true, pixels: PIXELS, ms: 0, drawn: 0 });

  const make = HTMLCanvasElement.prototype.getContext;
  HTMLCanvasElement.prototype.getContext = function (kind, options) {
    return make.call(this, kind, kind.startsWith("webgl") ? { ...options, antialias: false } : options);
  };

  // Callbacks of animation frames wait for their turn; those of one frame have it together.
  const request = window.requestAnimationFrame.bind(window), cancel = window.cancelAnimationFrame.bind(window);
  const waits = new Map(); // the number that a caller knows -> the one that waits now
  const gaps = []; // [ms] between two turns with a drawing in between
  let last = 0, due = 0;
  const turn = (now) => {
    const frame = window.__viserTestpoints?.rendererInfo.render.frame ?? 0;
    if (frame > state.drawn && now - last < 400) gaps.push(now - last);
    state.drawn = frame;
    due = Math.max(due + PACE, now);
    last = now;
  };
  window.requestAnimationFrame = (callback) => {
    let known = 0;
    const later = (now) => {
      if (now !== last && now < due) return void waits.set(known, request(later));
      if (now !== last) turn(now);
      waits.delete(known);
      callback(now);
    };
    known = request(later);
    return known;
  };
  window.cancelAnimationFrame = (known) => {
    cancel(waits.get(known) ?? known);
    waits.delete(known);
  };

  let deaf = 0; // until then frames say nothing: a change of size draws some
  const size = () => {
    const viser = window.__viserTestpoints, canvas = window.__viserMutable?.canvas;
    if (!viser || !canvas || FIXED) return;
    const box = canvas.getBoundingClientRect();
    const part = Math.sqrt(state.pixels / Math.max(box.width * box.height, 1));
    const wanted = state.moving ? Math.min(Math.round(20 * part) / 20, 1) : 1;
    if (viser.devSettings.get().fixedDpr === wanted) return;
    viser.devSettings.set({ fixedDpr: wanted });
    counts.length = gaps.length = 0;
    deaf = performance.now() + (state.moving ? 300 : 900);
  };
  const touched = () => {
    state.moving = true;
    size();
  };
  window.addEventListener("pointerdown", touched, true);
  window.addEventListener("wheel", touched, { capture: true, passive: true });

  const counts = []; // frames drawn in each of the last ticks
  let before = 0, ceiling = Infinity, bare = false;
  setInterval(() => {
    const viser = window.__viserTestpoints, mutable = window.__viserMutable;
    if (!viser || !mutable || !mutable.scene) return;
    if (mutable.backgroundMaterial && !bare) {
      // viser draws a picture behind the scene with a depth of its own, also where there is none: a pass over all pixels.
      mutable.scene.traverse((o) => {
        if (o.material === mutable.backgroundMaterial) bare = !(o.visible = false);
      });
    }
    const frame = viser.rendererInfo.render.frame, drawn = frame - before;
    before = frame;
    if (performance.now() < deaf) return;
    counts.push(drawn);
    if (counts.length > 4) counts.shift();
    if (counts.reduce((a, b) => a + b, 0) > 3) {
      // viser draws once a second at rest
      if (state.moving && gaps.length >= 5) {
        state.ms = gaps.reduce((a, b) => a + b, 0) / gaps.length;
        gaps.length = 0;
        if (state.ms > SLOW) {
          ceiling = state.pixels;
          state.pixels = Math.max(0.75 * state.pixels, FEWEST);
        } else if (state.ms < FAST && 1.25 * state.pixels < ceiling) state.pixels *= 1.25;
      }
      state.moving = true;
    } else if (counts.length >= 3) {
      state.moving = false;
      ceiling = Infinity;
    }
    size();
  }, TICK);
})();
