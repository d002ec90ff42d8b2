// A table of results, and plots on canvas.

/**
 * A curve of a plot: the name of its column, its label, the name of a colour, and `factor` and `offset`, which convert to the unit of the plot.
 * NaN is not drawn. A stepwise curve is constant from row to row. A goal is drawn dotted, with its label next to it.
 * @typedef {{name: string, label: string, colour: string, factor: number, offset?: number, isInteger?: boolean, isStepwise?: boolean, isGoal?: boolean}} Curve
 * A panel. `isNoted` panels show the notes of a motion.
 * @typedef {{title: string, unit: string, curves: Curve[], isNoted?: boolean}} Panel
 * A run for comparison, which is drawn in grey, and its label.
 * @typedef {{table: Table, label: string}} Comparison
 * A remark at a time (or at another abscissa) of the plot.
 * @typedef {[number, string]} Note
 */

/** Columns of numbers, all with `count` rows; the first is the time. */
class Table {
  /** @param {string[]} names */
  constructor(names) {
    this.count = 0;
    /** @type {Map<string, Float64Array>} */
    this.columns = new Map(["time", ...names].map((name) => [name, new Float64Array(4096)]));
  }

  /** @param {string} name */
  column(name) {
    const column = this.columns.get(name);
    if (!column) {
      throw new Error(`there is no ${name}`);
    }
    return column;
  }

  /** Makes room for one more row. */
  grow() {
    if (this.count === this.column("time").length) {
      for (const [name, column] of this.columns) {
        const longer = new Float64Array(2 * column.length);
        longer.set(column);
        this.columns.set(name, longer);
      }
    }
  }

  /** A copy of the rows. */
  copy() {
    const made = new Table([]);
    made.count = this.count;
    this.columns.forEach((column, name) => made.columns.set(name, column.slice(0, this.count)));
    return made;
  }

  /** The last time, s. */
  get end() {
    return this.count ? this.column("time")[this.count - 1] : 0;
  }

  /** The last row at or before a time. @param {number} time */
  row(time) {
    const times = this.column("time");
    let [low, high] = [0, this.count];
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      [low, high] = times[middle] <= time ? [middle, high] : [low, middle];
    }
    return low;
  }

  /** The value at a time, interpolated linearly. @param {string} name @param {number} time */
  at(name, time) {
    const [times, values, row] = [this.column("time"), this.column(name), this.row(time)];
    if (row + 1 >= this.count || time <= times[row]) {
      return values[row];
    }
    return values[row] + ((time - times[row]) / (times[row + 1] - times[row])) * (values[row + 1] - values[row]);
  }
}

/** Returns tick marks: multiples of 1, 2 or 5 times a power of ten, at most about `count` of them. @param {number} low @param {number} high @param {number} count */
function ticks(low, high, count) {
  const raw = (high - low) / count;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = power * ([1, 2, 5].find((factor) => factor * power >= raw) || 10);
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) {
    const text = digits > 4 && k ? Number((k * step).toPrecision(6)).toExponential() : (k * step).toFixed(digits > 4 ? 0 : digits);
    found.push({ value: k * step, text: text.replaceAll("-", "\u2212") });
  }
  return found;
}

/** Formats a number with about three digits. @param {number} value @param {number} scale the largest number of the plot */
function format(value, scale) {
  const digits = Math.max(0, Math.min(6, 2 - Math.floor(Math.log10(Math.max(scale, 1e-9)))));
  const text = value.toFixed(digits);
  return (Number(text) === 0 ? text.replace("-", "") : text).replace("-", "\u2212");
}

/** @template {keyof HTMLElementTagNameMap} T @param {T} tag @param {Record<string, string>} [attributes] @param {...(Node | string)} children */
function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    made.setAttribute(name, value);
  }
  made.append(...children);
  return made;
}

/** The sizes of canvases. An observer updates them, because reading `clientWidth` costs a layout. @type {WeakMap<Element, {width: number, height: number}>} */
const SIZES = new WeakMap();
const RESIZED = new ResizeObserver((entries) => entries.forEach(({ target, contentRect }) => SIZES.set(target, contentRect)));

/** The size of an element, px. @param {HTMLElement} canvas */
function sizeOf(canvas) {
  let size = SIZES.get(canvas);
  if (!size) {
    size = { width: canvas.clientWidth, height: canvas.clientHeight };
    SIZES.set(canvas, size);
    RESIZED.observe(canvas);
  }
  return size;
}

/** Clears a canvas and gives it the resolution of the screen. @param {HTMLCanvasElement} canvas */
function clear(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const { width, height } = sizeOf(canvas);
  const [pixelWidth, pixelHeight] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== pixelWidth || canvas.height !== pixelHeight) {
    [canvas.width, canvas.height] = [pixelWidth, pixelHeight];
  }
  const pen = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  return { pen, width, height };
}

/** The colours of the style sheet, cached until the colour scheme changes. @type {Map<string, string>} */
const COLOURS = new Map();
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => COLOURS.clear());

/** The value of a CSS custom property. @param {Element} target @param {string} name */
function colourAt(target, name) {
  let colour = COLOURS.get(name);
  if (!colour) {
    colour = getComputedStyle(target).getPropertyValue(`--${name}`).trim() || "#808080";
    COLOURS.set(name, colour);
  }
  return colour;
}

/** Panels of curves, one below the other. Only the last one names the time axis. */
class Plots {
  /** @param {Panel[]} panels @param {(time: number) => void} seek called with the time where a panel is touched @param {string} axis label of the abscissa */
  constructor(panels, seek, axis = "time (s)") {
    this.axis = axis;
    /** Whether the panels are next to each other, so that each names the axis. */
    this.isRow = false;
    this.panels = panels.map((panel) => this.panel(panel, seek));
    this.element = element("div", { class: "live-plots" }, ...this.panels.map((panel) => panel.figure));
    this.span = { begin: 0, end: 1 };
    /** Width of the tick labels on the left of all panels, px. */
    this.left = LEFT;
  }

  /** @param {Panel} panel @param {(time: number) => void} seek */
  panel(panel, seek) {
    const keys = panel.curves.map((curve, index) => {
      const value = element("span", { class: "live-number" });
      const key = element("span", { class: "live-key" }, curve.label, " ", value);
      key.style.setProperty("--colour", `var(--${curve.colour})`);
      key.classList.toggle("live-dashed", isDashed(panel, index));
      key.classList.toggle("live-goal", Boolean(curve.isGoal));
      return { value, key };
    });
    const unit = panel.unit ? ` (${panel.unit})` : "";
    const other = element("span", { class: "live-key", hidden: "" });
    other.style.setProperty("--colour", "var(--soft)");
    const caption = element("figcaption", {}, element("b", {}, panel.title + unit), " ", ...keys.map(({ key }) => key), other);
    const names = panel.curves.map((curve) => curve.label).join(", ");
    const canvas = element("canvas", { role: "img", "aria-label": `${panel.title}${unit}: ${names} over ${this.axis}` });
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      seek(this.timeAt(event.offsetX, sizeOf(canvas).width));
    });
    canvas.addEventListener("pointermove", (event) => {
      if (canvas.hasPointerCapture(event.pointerId)) {
        seek(this.timeAt(event.offsetX, sizeOf(canvas).width));
      }
    });
    return { panel, canvas, keys, other, figure: element("figure", panel.isNoted ? { class: "live-noted" } : {}, caption, canvas) };
  }

  /** @param {number} x @param {number} width */
  timeAt(x, width) {
    const { begin, end } = this.span;
    return begin + (end - begin) * Math.min(1, Math.max(0, (x - this.left) / (width - this.left - RIGHT)));
  }

  /**
   * Draws the trajectories from `begin` to `end`, and the parts after `now` pale.
   * @param {Table} table @param {number} now @param {number} begin @param {number} end
   * @param {Comparison | null} [other] @param {Note[]} [notes]
   */
  draw(table, now, begin, end, other = null, notes = []) {
    this.span = { begin, end };
    const axes = this.panels.map(({ panel, canvas }) => {
      const surface = clear(canvas);
      const { pen } = surface;
      pen.font = FONT;
      const ranges = [table, ...(other ? [other.table] : [])].map((run) => range(panel, run, ...rowsOf(run, begin, end)));
      const [low, high] = [Math.min(...ranges.map(([one]) => one)), Math.max(...ranges.map(([, one]) => one))];
      const marks = ticks(low, high, 5);
      return { surface, low, high, marks, textWidth: Math.max(...marks.map(({ text }) => pen.measureText(text).width)) };
    });
    // The width changes in steps, so that the axes do not move with each digit.
    this.left = Math.max(LEFT, 8 * Math.ceil((12 + Math.max(...axes.map(({ textWidth }) => textWidth))) / 8));
    let isNamed = false;
    for (const [index, panel] of this.panels.entries()) {
      // The first panel in which the runs clearly differ names the other run.
      const { low, high } = axes[index];
      /** @type {boolean} */
      const isApart = !isNamed && other !== null && table.count > 0 && gap(panel.panel, table, other.table, begin, end) > 0.03 * (high - low);
      isNamed ||= isApart;
      panel.other.hidden = !isApart;
      panel.other.textContent = other?.label ?? "";
      this.drawPanel(panel, axes[index], table, now, this.isRow || index === this.panels.length - 1, other, panel.panel.isNoted ? notes : []);
    }
  }

  /**
   * @param {ReturnType<Plots["panel"]>} drawn
   * @param {{surface: ReturnType<typeof clear>, low: number, high: number, marks: {value: number, text: string}[]}} axis
   * @param {Table} table @param {number} now @param {boolean} isLast @param {Comparison | null} other @param {Note[]} notes
   */
  drawPanel({ panel, keys }, { surface: { pen, width, height }, low, high, marks }, table, now, isLast, other, notes) {
    const colour = (/** @type {string} */ name) => colourAt(this.element, name);
    const { begin, end } = this.span;
    const area = { left: this.left, right: width - RIGHT, top: notes.length ? 22 : 6, bottom: height - (isLast ? 34 : 20) };
    const x = (/** @type {number} */ time) => area.left + ((time - begin) / (end - begin)) * (area.right - area.left);
    const y = (/** @type {number} */ value) => area.bottom - ((value - low) / (high - low)) * (area.bottom - area.top);
    this.drawGrid(pen, area, marks.map(({ value, text }) => ({ text, at: y(value) })), ticks(begin, end, Math.min(8, width / 60)).map(({ value, text }) => ({ text, at: x(value) })), isLast);
    let noted = 0;
    const say = (/** @type {string} */ text, /** @type {number} */ left) => {
      const half = pen.measureText(text).width / 2 + 2;
      const middle = Math.max(area.left + half, Math.min(area.right - half, left));
      // In a narrow plot, a note that would cover the one before is left out.
      if (middle - half < noted) {
        return;
      }
      noted = middle + half;
      pen.textAlign = "center";
      pen.textBaseline = "alphabetic";
      pen.lineWidth = 3;
      pen.strokeStyle = colour("paper-here");
      pen.strokeText(text, middle, 13);
      pen.lineWidth = 1;
      pen.fillStyle = colour("ink");
      pen.fillText(text, middle, 13);
    };
    if (table.count) {
      pen.strokeStyle = colour("soft");
      line(pen, [x(now), area.top], [x(now), area.bottom]);
    }
    pen.lineJoin = "round";
    pen.strokeStyle = colour("soft");
    for (const curve of other ? panel.curves.filter(({ isGoal }) => !isGoal) : []) {
      const run = /** @type {Comparison} */ (other).table;
      const column = run.column(curve.name);
      drawCurve(pen, run.column("time"), x, (row) => y(curve.factor * column[row] + (curve.offset || 0)), ...rowsOf(run, begin, end), curve.isStepwise);
    }
    const [first, last] = rowsOf(table, begin, end);
    for (const [index, curve] of panel.curves.entries()) {
      const column = table.column(curve.name);
      const value = (/** @type {number} */ row) => y(curve.factor * column[row] + (curve.offset || 0));
      const until = Math.min(table.row(now), last);
      pen.strokeStyle = colour(curve.colour);
      pen.setLineDash(curve.isGoal ? [1.5, 3] : isDashed(panel, index) ? [5, 3] : []);
      pen.globalAlpha = 0.35;
      drawCurve(pen, table.column("time"), x, value, until, last, curve.isStepwise);
      pen.globalAlpha = 1;
      pen.lineWidth = curve.isGoal ? 1.3 : 1.8;
      drawCurve(pen, table.column("time"), x, value, first, until, curve.isStepwise);
      pen.setLineDash([]);
      pen.lineWidth = 1;
      if (table.count) {
        const here = curve.factor * (curve.isStepwise ? column[table.row(now)] : table.at(curve.name, now)) + (curve.offset || 0);
        keys[index].key.hidden = Number.isNaN(here);
        if (!curve.isGoal) {
          pen.fillStyle = colour(curve.colour);
          pen.beginPath();
          pen.arc(x(Math.min(now, table.end)), y(here), 3.5, 0, 2 * Math.PI);
          pen.fill();
        }
        const text = curve.isInteger ? String(Math.round(here)) : format(here, Math.max(Math.abs(low), Math.abs(high)));
        if (keys[index].value.textContent !== text) {
          keys[index].value.textContent = text;
        }
      }
    }
    notes.forEach(([time, text]) => say(text, x(time)));
  }

  /**
   * Draws the grid and its labels.
   * @param {CanvasRenderingContext2D} pen @param {{left: number, right: number, top: number, bottom: number}} area
   * @param {{text: string, at: number}[]} rows @param {{text: string, at: number}[]} columns @param {boolean} isLast
   */
  drawGrid(pen, { left, right, top, bottom }, rows, columns, isLast) {
    pen.lineWidth = 1;
    pen.strokeStyle = colourAt(this.element, "grid");
    pen.fillStyle = colourAt(this.element, "soft");
    pen.textAlign = "right";
    pen.textBaseline = "middle";
    for (const { text, at } of rows) {
      line(pen, [left, at], [right, at]);
      pen.fillText(text, left - 6, at);
    }
    pen.textAlign = "center";
    pen.textBaseline = "top";
    for (const { text, at } of columns) {
      line(pen, [at, top], [at, bottom]);
      pen.fillText(text, at, bottom + 5);
    }
    if (isLast) {
      pen.fillText(this.axis, (left + right) / 2, bottom + 20);
    }
  }
}

/** Whether a curve is dashed, so that neighbouring curves of a panel differ without colour. @param {Panel} panel @param {number} index */
function isDashed(panel, index) {
  return panel.curves.slice(0, index).filter(({ isGoal }) => !isGoal).length % 2 === 1 && !panel.curves[index].isGoal;
}

/** The largest distance between the curves of two runs. @param {Panel} panel @param {Table} table @param {Table} other @param {number} begin @param {number} end */
function gap(panel, table, other, begin, end) {
  let found = 0;
  for (const { name, factor } of panel.curves.filter(({ isGoal }) => !isGoal)) {
    const [times, column] = [other.column("time"), other.column(name)];
    const [first, last] = rowsOf(other, begin, Math.min(end, table.end));
    for (let row = first; row <= last; row += Math.max(1, (last - first) >> 9)) {
      found = Math.max(found, Math.abs(factor * (column[row] - table.at(name, times[row]))));
    }
  }
  return found;
}

/** Smallest margins of a panel, px, and the font of the tick labels. */
const [LEFT, RIGHT, FONT] = [46, 16, "12px system-ui, sans-serif"];

/** The first and the last row of a time span. @param {Table} table @param {number} begin @param {number} end @returns {[number, number]} */
function rowsOf(table, begin, end) {
  return [table.row(begin), Math.min(table.row(end) + 1, table.count - 1)];
}

/** The range of an axis: the smallest and the largest value of these rows, with a margin. @param {Panel} panel @param {Table} table @param {number} first @param {number} last */
function range(panel, table, first, last) {
  let [low, high] = [Infinity, -Infinity];
  for (const { name, factor, offset = 0 } of panel.curves) {
    const column = table.column(name);
    for (let row = first; row <= last; row++) {
      const value = factor * column[row] + offset;
      low = value < low ? value : low;
      high = value > high ? value : high;
    }
  }
  if (!(low <= high)) {
    return [-1, 1];
  }
  const most = Math.max(Math.abs(low), Math.abs(high));
  const margin = most < 1e-12 ? 1 : Math.max(0.08 * (high - low), 1e-3 * most);
  return [low - margin, high + margin];
}

/** @param {CanvasRenderingContext2D} pen @param {number[]} start @param {number[]} end */
function line(pen, start, end) {
  pen.beginPath();
  pen.moveTo(start[0], start[1]);
  pen.lineTo(end[0], end[1]);
  pen.stroke();
}

/**
 * Draws a curve from row to row. Of many rows in one pixel, it draws the extremes.
 * @param {CanvasRenderingContext2D} pen @param {Float64Array} times
 * @param {(time: number) => number} x @param {(row: number) => number} y @param {number} first @param {number} last
 * @param {boolean} [isStepwise] whether the value is constant until the next row
 */
function drawCurve(pen, times, x, y, first, last, isStepwise = false) {
  if (!(last > first)) {
    return;
  }
  pen.beginPath();
  pen.moveTo(x(times[first]), y(first));
  for (let row = first + 1; row <= last; ) {
    const pixel = Math.floor(x(times[row]));
    let [low, high] = [Infinity, -Infinity];
    let next = row;
    for (; next <= last && Math.floor(x(times[next])) === pixel; next++) {
      const here = y(next);
      low = here < low ? here : low;
      high = here > high ? here : high;
    }
    if (next - row > 2) {
      if (isStepwise) {
        pen.lineTo(pixel, y(row - 1));
      }
      const isRising = y(next - 1) > y(row);
      pen.lineTo(pixel, isRising ? low : high);
      pen.lineTo(pixel + 0.5, isRising ? high : low);
      pen.lineTo(x(times[next - 1]), y(next - 1));
    } else {
      for (let k = row; k < next; k++) {
        if (isStepwise) {
          pen.lineTo(x(times[k]), y(k - 1));
        }
        pen.lineTo(x(times[k]), y(k));
      }
    }
    row = next;
  }
  pen.stroke();
}
