// Put into a page that stands alone, beside software.js. Each time its film begins anew viser switches its own lights on for
// a moment, with shadows and light from all around: a flash, and a second of work without a graphics card. They are kept off.
(() => {
  const OWN = 1.5; // lights of ours are stronger, those of viser weaker
  const timer = setInterval(() => {
    const scene = window.__viserMutable?.scene;
    if (!scene) return;
    clearInterval(timer);
    const before = scene.onBeforeRender;
    scene.onBeforeRender = function (...all) {
      scene.environment = null;
      scene.traverse((o) => {
        if (o.isLight && o.intensity < OWN) o.visible = false;
      });
      return before.apply(this, all);
    };
  }, 20);
})();
