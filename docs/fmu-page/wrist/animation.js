// Plays a recorded run on a separate page: prw.animate(run, "run.html").

/**
 * @param {{title: string, columns: Record<string, string>, speed: number, captions: [number, string][]}} run
 * each column is an array of 8-byte floats in base 64
 */
function animation(run) {
  const table = new Table([]);
  for (const [name, text] of Object.entries(run.columns)) {
    const bytes = Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
    table.columns.set(name, new Float64Array(bytes.buffer));
  }
  table.count = table.column("time").length;
  const [begin, end] = [table.column("time")[0], table.end];
  const wrist = new Wrist(WRIST, null);
  const caption = element("p", { class: "live-caption" });
  const view = {
    element: element("div", {}, caption, wrist.element),
    draw: (/** @type {Table} */ results, /** @type {number} */ time) => {
      const passed = run.captions.filter(([start]) => start <= time + 1e-9);
      caption.textContent = passed.length ? passed[passed.length - 1][1] : "";
      wrist.draw(results, time);
    },
  };
  const player = new Player({
    plots: (seek) => new Plots(WRIST_PANELS, seek), view, begin, isLooping: () => true, table,
    span: () => [begin, end], recorded: () => end, limit: () => end,
  });
  const isPlaying = player.isPlaying;
  player.setSpeed(run.speed);
  player.setPlaying(isPlaying);
  document.body.append(element("main", { class: "live-page" }, element("h1", {}, run.title), player.element));
}
