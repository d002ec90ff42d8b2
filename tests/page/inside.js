// test_browsers.py adds this script to a copy of the page. It acts like a visitor and reports the results.
(async () => {
  const report = { agent: navigator.userAgent, runs: {}, errors: [], requests: 0 };
  addEventListener("error", (event) => report.errors.push(event.message));
  addEventListener("unhandledrejection", (event) => report.errors.push(String(event.reason)));
  const wait = (ms) => new Promise((done) => setTimeout(done, ms));
  const until = async (condition, ms = 20000) => {
    for (const begin = performance.now(); performance.now() - begin < ms; await wait(20)) {
      if (condition()) {
        return;
      }
    }
    throw new Error(`the condition stays false: ${condition}`);
  };
  const find = (selector) => document.querySelector(selector);
  const button = (text) => [...document.querySelectorAll(".live button")].find((one) => one.textContent === text);
  // Keeps saved files instead of downloading them, because a browser that asks where to save a file stops drawing.
  let saved = null;
  HTMLAnchorElement.prototype.click = () => {};
  URL.createObjectURL = (blob) => ((saved = blob), "data:,");
  const csv = async () => {
    saved = null;
    button("Save as CSV").click();
    await until(() => saved);
    return saved.text();
  };
  const change = (field, value) => {
    field.value = value;
    field.dispatchEvent(new Event(field.type === "range" ? "input" : "change"));
  };
  const go = async (settings) => {
    location.hash = `try&${new URLSearchParams(settings)}`;
    await wait(50);
  };
  try {
    await until(() => find("#try"));
    const clock = find(".live-clock");
    // Some browsers prefer reduced motion if they run without a screen.
    report.reduced = matchMedia("(prefers-reduced-motion: reduce)").matches;
    if (report.reduced) {
      await wait(500);
      const shown = clock.textContent;
      await wait(500);
      report.waits = parseFloat(shown) > 0 && clock.textContent === shown;
      button("Play").click();
    }
    await until(() => parseFloat(clock.textContent) > 0);
    report.first = performance.now();
    let frames = 0;
    const begin = performance.now();
    await new Promise((done) => {
      const count = () => (performance.now() - begin > 2000 ? done() : (frames++, requestAnimationFrame(count)));
      requestAnimationFrame(count);
    });
    report.frames = (1000 * frames) / (performance.now() - begin);
    for (const [name, parameters] of Object.entries(window.settings)) {
      await go({ motion: name, speed: "Infinity", ...parameters });
      report.runs[name] = { parameters, csv: await csv() };
    }
    for (const { value } of find("#live-motion").options) {
      if (value !== "hand" && !(value in window.settings)) {
        await go({ motion: value, speed: "Infinity" });
        report.runs[value] = { parameters: { use_omega: true }, csv: await csv() };
      }
    }
    // Sets a motor angle during a motion, which ends the motion. Then sets a parameter, which leaves the inputs as they are.
    await go({ motion: "tour", speed: "1" });
    await until(() => parseFloat(clock.textContent) > 0.2 && parseFloat(clock.textContent) < 0.9);
    change(find("#live-theta1"), "30");
    await until(() => parseFloat(clock.textContent) > 0.6);
    change(find("#live-k1"), "1");
    await wait(200);
    button("Pause").click();
    report.runs.hand = { parameters: { use_omega: true, k1: (1 / Math.PI) * 180 }, csv: await csv() };
    report.motion = find("#live-motion").value;
    change(find("#live-k1"), "-1");
    await until(() => find("#live-k1-message").textContent);
    report.error = find("#live-k1-message").textContent;
    change(find("#live-k1"), "2");
    await until(() => !find("#live-k1-message").textContent);
    button("Link to this").click();
    await wait(50);
    report.link = location.hash;
    const scene = find(".live-scene");
    const colours = new Uint32Array(scene.getContext("2d").getImageData(0, 0, scene.width, scene.height).data.buffer);
    report.painted = colours.filter((colour) => colour).length / colours.length;
    report.wide = document.documentElement.scrollWidth > innerWidth;
    report.guid = find(".live code").textContent;
    report.requests = performance.getEntriesByType("resource").length;
  } catch (error) {
    report.errors.push(String(error));
  }
  await fetch(window.address, { method: "POST", mode: "no-cors", body: JSON.stringify(report) });
})();
