// Put into a copy of the page by test_browsers.py: does what a visitor does, and tells what came of it.
(async () => {
  const told = { agent: navigator.userAgent, runs: {}, errors: [], requests: 0 };
  addEventListener("error", (event) => told.errors.push(event.message));
  addEventListener("unhandledrejection", (event) => told.errors.push(String(event.reason)));
  const wait = (ms) => new Promise((done) => setTimeout(done, ms));
  const until = async (what, ms = 20000) => {
    for (const begin = performance.now(); performance.now() - begin < ms; await wait(20)) {
      if (what()) {
        return;
      }
    }
    throw new Error(`this never happens: ${what}`);
  };
  const find = (selector) => document.querySelector(selector);
  const button = (text) => [...document.querySelectorAll(".live button")].find((one) => one.textContent === text);
  // What is saved is caught, and not downloaded: a browser that asks where to stops drawing.
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
    // Some browsers say so where they run without a screen.
    told.reduced = matchMedia("(prefers-reduced-motion: reduce)").matches;
    if (told.reduced) {
      await wait(500);
      told.waits = parseFloat(clock.textContent) === 0;
      button("Play").click();
    }
    await until(() => parseFloat(clock.textContent) > 0);
    told.first = performance.now();
    let frames = 0;
    const begin = performance.now();
    await new Promise((done) => {
      const count = () => (performance.now() - begin > 2000 ? done() : (frames++, requestAnimationFrame(count)));
      requestAnimationFrame(count);
    });
    told.frames = (1000 * frames) / (performance.now() - begin);
    for (const [name, parameters] of Object.entries(window.settings)) {
      await go({ motion: name, speed: "Infinity", ...parameters });
      told.runs[name] = { parameters, csv: await csv() };
    }
    for (const { value } of find("#live-motion").options) {
      if (value !== "hand" && !(value in window.settings)) {
        await go({ motion: value, speed: "Infinity" });
        told.runs[value] = { parameters: { use_omega: true }, csv: await csv() };
      }
    }
    // By hand from the middle of a motion, then with another parameter: the same inputs again.
    await go({ motion: "tour", speed: "1" });
    await until(() => parseFloat(clock.textContent) > 0.2 && parseFloat(clock.textContent) < 0.9);
    change(find("#live-theta1"), "30");
    await until(() => parseFloat(clock.textContent) > 0.6);
    change(find("#live-k1"), "1");
    await wait(200);
    button("Pause").click();
    told.runs.hand = { parameters: { use_omega: true, k1: (1 / Math.PI) * 180 }, csv: await csv() };
    told.motion = find("#live-motion").value;
    change(find("#live-k1"), "-1");
    await until(() => find(".live-error"));
    told.refusal = find(".live-status").textContent;
    change(find("#live-k1"), "2");
    await until(() => !find(".live-error"));
    button("Link to this").click();
    await wait(50);
    told.link = location.hash;
    told.wide = document.documentElement.scrollWidth > innerWidth;
    told.guid = find(".live code").textContent;
    told.requests = performance.getEntriesByType("resource").length;
  } catch (error) {
    told.errors.push(String(error));
  }
  await fetch(window.report, { method: "POST", mode: "no-cors", body: JSON.stringify(told) });
})();
