// A run of the FMU with its table of results.

/**
 * A motion: a function that sets the inputs at a time. `table` has the results so far; a motion may write its own columns of the next
 * row. The motion `other` is drawn in grey for comparison, with its label. `frequency` returns the frequency of a vibration, Hz.
 * `notes` are drawn in the plots.
 * @typedef {{id: string, title: string, length: number, other?: {id: string, label: string}, notes?: Note[], frequency?(time: number): number, begin?(): void,
 *   inputs(time: number, inputs: Record<string, number>, table: Table): void}} Motion
 * A second FMU that runs together with the FMU of the page, from the first row: `step` simulates it up to a time with the values in the last
 * row of the table, and sets inputs and columns of the new row.
 * @typedef {{begin(start: Map<Variable, number | string>): void, step(time: number, inputs: Record<string, number>, table: Table): void}} Companion
 */

/** Length of a run by hand, s, unless the default experiment is longer; and the largest number of rows. */
const [MAX_BY_HAND, MAX_ROWS] = [120, 300000];
/** Calculation time per frame, ms. */
const BUDGET = 10;

/** A run of the FMU. It is calculated up to the requested time, and again after a change. */
class Session {
  /** @param {Package} own @param {AddOn} addOn */
  constructor(own, { recorded, written, companion }) {
    const { description } = own;
    this.own = own;
    this.description = description;
    this.inputs = description.numbers("input");
    const outputs = description.variables.filter((one) => (one.causality === "output" || recorded.includes(one.name)) && one.type !== "String");
    this.outputs = outputs.filter((one) => !this.inputs.includes(one));
    this.written = written;
    this.companion = companion;
    this.table = new Table([...[...this.inputs, ...this.outputs].map((one) => one.name), ...written]);
    /** Start values that differ from the FMU's own. @type {Map<Variable, number | string>} */
    this.start = new Map();
    /** @type {Motion | null} */
    this.motion = null;
    /** Positions of the sliders in a run by hand. @type {Map<string, number>} */
    this.targets = new Map();
    /** Number of rows whose inputs are kept when the run is calculated again. */
    this.known = 0;
    this.error = "";
    /** Time at which the FMU terminated the run, s. */
    this.ended = Infinity;
    this.isBegun = false;
    /** The inputs of the last row. @type {Record<string, number>} */
    this.now = {};
    this.values = { inputs: new Float64Array(this.inputs.length), outputs: new Float64Array(this.outputs.length) };
    this.instance = this.connect();
  }

  /** Creates an instance and the groups of its inputs and outputs. */
  connect() {
    const fmu = new Fmu(this.own);
    return { fmu, inputs: fmu.group(this.inputs), outputs: fmu.group(this.outputs) };
  }

  /** Whether the run has failed, for example because the FMU rejected a value. A run that the FMU terminated has not failed. */
  get isRejected() {
    return this.error !== "" && this.ended === Infinity;
  }

  /** Starts the run again. The first `known` rows keep their inputs. @param {number} known */
  restart(known) {
    this.known = Math.min(known, Math.max(this.table.count, this.known));
    this.table.count = 0;
    this.isBegun = false;
    this.error = "";
    this.ended = Infinity;
  }

  /** Starts a run by hand again with the inputs of the last row. */
  renew() {
    for (const { name } of this.inputs) {
      const column = this.table.column(name);
      column[0] = column[this.table.count - 1];
    }
    this.restart(1);
  }

  /** @param {number} row */
  timeOf(row) {
    return this.description.startTime + row * this.description.step;
  }

  /** Calculates until a time, or until the calculation time of a frame is used up; returns the time reached, or `time` after an error. @param {number} time @param {(inputs: Record<string, number>) => void} follow */
  advance(time, follow) {
    const stop = performance.now() + BUDGET;
    try {
      while (!this.error && this.timeOf(this.table.count) <= time + 0.5 * this.description.step && this.table.count < MAX_ROWS) {
        if (this.table.count % 64 === 0 && performance.now() > stop) {
          break;
        }
        this.addRow(follow);
      }
    } catch (error) {
      if (error instanceof Terminated) {
        [this.error, this.ended] = [error.message, this.table.end];
      } else {
        this.error = (error instanceof Error ? error.message : String(error)).replace(/^fmi2\w+: /, "");
      }
      this.instance = this.connect();
      this.isBegun = false;
    }
    return this.error ? time : this.table.end;
  }

  /** Calculates until a time, regardless of the calculation time. @param {number} time @param {(inputs: Record<string, number>) => void} follow */
  finish(time, follow) {
    while (this.advance(time, follow) < time - this.description.step) {}
  }

  /** Calculates one row: the step to its time, its inputs, its outputs. @param {(inputs: Record<string, number>) => void} follow */
  addRow(follow) {
    const { table, values, now } = this;
    const { fmu, inputs, outputs } = this.instance;
    const row = table.count;
    const time = this.timeOf(row);
    if (!this.isBegun) {
      fmu.begin(this.start);
      this.isBegun = true;
      this.companion?.begin(this.start);
      this.motion?.begin?.();
      this.inputs.forEach((one) => (now[one.name] = startOf(one)));
    } else {
      fmu.stepTo(time);
    }
    table.grow();
    if (row < this.known) {
      for (const { name } of this.inputs) {
        now[name] = table.column(name)[row];
      }
    } else {
      this.written.forEach((name) => (table.column(name)[row] = NaN));
      if (this.motion) {
        this.motion.inputs(time - this.description.startTime, now, table);
      } else if (row > 0) {
        follow(now);
      }
    }
    this.companion?.step(time, now, table);
    this.inputs.forEach(({ name }, index) => (table.column(name)[row] = values.inputs[index] = now[name]));
    fmu.set(inputs, values.inputs);
    fmu.get(outputs, values.outputs);
    this.outputs.forEach(({ name }, index) => (table.column(name)[row] = values.outputs[index]));
    table.column("time")[row] = time;
    table.count = row + 1;
  }

  /** Returns the value that a parameter has in this run. @param {Variable} one */
  parameter(one) {
    return this.start.get(one) ?? (one.type === "String" ? one.start || "" : startOf(one));
  }

  /** Returns a CSV file: comments that name the FMU and its parameters, then all rows in the units of the FMU and with all digits. */
  csv() {
    const { identifier, version, guid, variables } = this.description;
    const parameters = variables.filter((one) => one.causality === "parameter").map((one) => `${one.name} = ${JSON.stringify(this.parameter(one))}`);
    const about = [`# ${identifier} ${version}, guid ${guid}`, `# ${parameters.join(", ")}`];
    const names = ["time", ...this.inputs.map((one) => one.name), ...this.outputs.map((one) => one.name), ...this.written.filter((name) => !Number.isNaN(this.table.column(name)[0]))];
    const columns = names.map((name) => this.table.column(name));
    const lines = [...about, names.map((name) => (/[",\s]/.test(name) ? `"${name.replaceAll('"', '""')}"` : name)).join(",")];
    for (let row = 0; row < this.table.count; row++) {
      lines.push(columns.map((column) => String(column[row])).join(","));
    }
    return `${lines.join("\n")}\n`;
  }
}
