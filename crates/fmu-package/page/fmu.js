// The FMU: its model description, and the FMI 2.0 functions of its WebAssembly module.

/**
 * A variable of the model description. `factor * value + offset` is the value in `unit`, the unit of the page.
 * @typedef {{
 *   name: string, reference: number, description: string, causality: string, variability: string,
 *   type: string, start: string | null, min: number, max: number, nominal: number,
 *   unit: string, factor: number, offset: number, items: {name: string, value: number}[],
 * }} Variable
 */

/**
 * Variables of one base type, which one call reads or sets: their indices in a list of variables, and the addresses of their
 * value references and values in the module's memory.
 * @typedef {{base: "Real" | "Integer" | "Boolean", indices: number[], references: number, values: number}} Group
 */

/**
 * An FMU in the page. `files` contains its resources by name.
 * @typedef {{description: Description, module: WebAssembly.Module, files: Map<string, Uint8Array>}} Package
 */

/**
 * The exports of the module: FMI functions and the memory.
 * @typedef {Record<string, (...values: number[]) => number> & {memory: WebAssembly.Memory}} Exports
 */

/** An FMI function returned an error; the message is the FMU's. */
class FmuError extends Error {
  /** @param {string} message @param {number} [status] */
  constructor(message, status = 3) {
    super(message);
    this.status = status;
  }
}
/** The FMU terminated the run (`fmi2Terminated`). */
class Terminated extends FmuError {
  /** @param {number} time s */
  constructor(time) {
    super(`The FMU has ended the run at ${Number(time.toPrecision(6))} s.`);
    this.time = time;
  }
}

/** `fmi2Discard`, and the `fmi2StatusKind`s that are read after it (FMI 2.0.5, section 4.2.3). */
const [DISCARD, LAST_SUCCESSFUL_TIME, TERMINATED] = [2, 2, 3];

class Description {
  /** @param {string} text modelDescription.xml of FMI 2.0 */
  constructor(text) {
    const root = new DOMParser().parseFromString(text, "text/xml").documentElement;
    /** @param {string} name */
    const attribute = (name) => root.getAttribute(name) || "";
    const experiment = root.querySelector("DefaultExperiment");
    /** @param {string} name @param {number} otherwise */
    const time = (name, otherwise) => Number(experiment?.getAttribute(name) || otherwise);
    this.name = attribute("modelName");
    this.description = attribute("description");
    this.guid = attribute("guid");
    this.version = attribute("version");
    this.identifier = root.querySelector("CoSimulation")?.getAttribute("modelIdentifier") || "";
    this.startTime = time("startTime", 0);
    this.stopTime = time("stopTime", this.startTime + 1);
    this.step = time("stepSize", (this.stopTime - this.startTime) / 1000);
    const types = new Map([...root.querySelectorAll("SimpleType")].map((type) => [type.getAttribute("name"), type]));
    const units = new Map([...root.querySelectorAll("UnitDefinitions > Unit")].map((unit) => [unit.getAttribute("name"), unit]));
    this.variables = [...root.querySelectorAll("ScalarVariable")].map((element) => variable(element, types, units));
    this.byName = new Map(this.variables.map((one) => [one.name, one]));
  }

  /** The variables of a causality that are not strings. @param {string} causality */
  numbers(causality) {
    return this.variables.filter((one) => one.causality === causality && one.type !== "String");
  }
}

/** @param {Element} element @param {Map<string | null, Element>} types @param {Map<string | null, Element>} units */
function variable(element, types, units) {
  const value = /** @type {Element} */ (element.firstElementChild);
  const declared = types.get(value.getAttribute("declaredType"));
  /** @param {string} name */
  const attribute = (name) => value.getAttribute(name) ?? declared?.firstElementChild?.getAttribute(name) ?? null;
  /** @param {string} name @param {number} otherwise */
  const number = (name, otherwise) => (attribute(name) === null ? otherwise : Number(attribute(name)));
  const display = [...(units.get(attribute("unit"))?.querySelectorAll("DisplayUnit") || [])].find(
    (unit) => unit.getAttribute("name") === attribute("displayUnit"),
  );
  return {
    name: element.getAttribute("name") || "",
    reference: Number(element.getAttribute("valueReference")),
    description: element.getAttribute("description") || "",
    causality: element.getAttribute("causality") || "local",
    variability: element.getAttribute("variability") || "continuous",
    type: value.tagName,
    start: attribute("start"),
    min: number("min", -Infinity),
    max: number("max", Infinity),
    nominal: number("nominal", 1),
    unit: ((display ? attribute("displayUnit") : attribute("unit")) || "").replace(/^1$/, ""),
    factor: Number(display?.getAttribute("factor") || 1),
    offset: Number(display?.getAttribute("offset") || 0),
    items: [...(declared?.querySelectorAll("Item") || [])].map((item) => ({
      name: item.getAttribute("name") || "",
      value: Number(item.getAttribute("value")),
    })),
  };
}

/** The start value as a number. @param {Variable} one */
function startOf(one) {
  return one.type === "Boolean" ? Number(one.start === "true" || one.start === "1") : Number(one.start || 0);
}

/** The base type of the FMI functions: enumerations are Integers. @param {Variable} one @returns {"Real" | "Integer" | "Boolean"} */
function baseOf(one) {
  return one.type === "Real" || one.type === "Boolean" ? one.type : "Integer";
}

/** An instance for Co-Simulation. Each one has its own module memory. */
class Fmu {
  /** @param {Package} own */
  constructor({ description, module, files }) {
    this.description = description;
    this.module = module;
    this.time = description.startTime;
    /** @type {string[]} */
    this.messages = [];
    /** @param {number} _status @param {number} _category @param {number} message */
    const log = (_status, _category, message) => void this.messages.push(this.text(message));
    const instance = new WebAssembly.Instance(module, { fmu: { fmu_log: log } });
    this.functions = /** @type {Exports} */ (/** @type {unknown} */ (instance.exports));
    for (const [name, content] of files) {
      this.next = this.functions.fmu_argument_buffer(content.length + 4 * name.length + 64);
      const [path, address] = [this.put(`/resources/${name}`), this.take(content.length)];
      new Uint8Array(this.functions.memory.buffer, address, content.length).set(content);
      this.functions.fmu_file(path, address, content.length);
    }
    // Memory for value references, values and strings.
    this.next = this.functions.fmu_argument_buffer(8192 + 128 * description.variables.length);
    const strings = [description.identifier, description.guid, files.size ? "file:///resources" : ""];
    const [name, guid, resources] = strings.map((text) => this.put(text));
    const callbacks = this.take(20);
    new Uint8Array(this.functions.memory.buffer, callbacks, 20).fill(0);
    /** The `fmi2Component`; 0 if there is none. */
    this.instance = this.functions.fmi2Instantiate(name, 1, guid, resources, callbacks, 0, 0);
    if (!this.instance) {
      throw new FmuError(this.lastMessages("fmi2Instantiate"));
    }
    this.isNew = true;
  }

  /** Initializes the instance with these start values. @param {Map<Variable, number | string>} start */
  begin(start) {
    if (!this.isNew) {
      this.call("fmi2Reset");
    }
    this.isNew = false;
    this.time = this.description.startTime;
    this.call("fmi2SetupExperiment", 0, 0, this.time, 0, 0);
    for (const [one, value] of start) {
      const unused = this.next;
      if (typeof value === "string") {
        const [string, reference, strings] = [this.put(value), this.take(4), this.take(4)];
        const memory = new Uint32Array(this.functions.memory.buffer);
        [memory[reference / 4], memory[strings / 4]] = [one.reference, string];
        this.call("fmi2SetString", reference, 1, strings);
      } else {
        this.set(this.group([one]), [value]);
      }
      this.next = unused;
    }
    this.call("fmi2EnterInitializationMode");
    this.call("fmi2ExitInitializationMode");
  }

  /** Allocates memory for variables that are set or read together. @param {Variable[]} variables */
  group(variables) {
    return /** @type {Group["base"][]} */ (["Real", "Integer", "Boolean"]).flatMap((base) => {
      const indices = [...variables.keys()].filter((index) => baseOf(variables[index]) === base);
      if (indices.length === 0) {
        return [];
      }
      const [references, values] = [this.take(4 * indices.length), this.take(8 * indices.length)];
      const numbers = new Uint32Array(this.functions.memory.buffer, references, indices.length);
      numbers.set(indices.map((index) => variables[index].reference));
      return [{ base, indices, references, values }];
    });
  }

  /** @param {Group[]} groups @param {ArrayLike<number>} values in the order of the variables */
  set(groups, values) {
    for (const group of groups) {
      const numbers = this.numbers(group);
      for (let k = 0; k < numbers.length; k++) {
        numbers[k] = values[group.indices[k]];
      }
      this.call(`fmi2Set${group.base}`, group.references, numbers.length, group.values);
    }
  }

  /** @param {Group[]} groups @param {Float64Array} values in the order of the variables */
  get(groups, values) {
    for (const group of groups) {
      const { length } = group.indices;
      this.call(`fmi2Get${group.base}`, group.references, length, group.values);
      const numbers = this.numbers(group);
      for (let k = 0; k < length; k++) {
        values[group.indices[k]] = numbers[k];
      }
    }
  }

  /** Does a communication step to `time`, s. @param {number} time */
  stepTo(time) {
    try {
      this.call("fmi2DoStep", this.time, time - this.time, 1);
    } catch (error) {
      if (!(error instanceof FmuError && error.status === DISCARD)) {
        throw error;
      }
      const address = this.take(8);
      const { buffer } = this.functions.memory;
      if (this.functions.fmi2GetBooleanStatus(this.instance, TERMINATED, address) === 0 && new Int32Array(buffer, address, 1)[0]) {
        this.call("fmi2GetRealStatus", LAST_SUCCESSFUL_TIME, address);
        throw new Terminated(new Float64Array(buffer, address, 1)[0]);
      }
      throw error;
    }
    this.time = time;
  }

  /** Calls a function of the instance; throws the FMU's message if the status is worse than `fmi2Warning`. @param {string} name @param {...number} values */
  call(name, ...values) {
    let status;
    try {
      status = this.functions[name](this.instance, ...values);
    } catch (trap) {
      throw trap instanceof WebAssembly.RuntimeError ? new FmuError(`${name}: the FMU has failed: ${trap.message}`) : trap;
    }
    if (status > 1) {
      throw new FmuError(this.lastMessages(name), status);
    }
  }

  /** The messages since the last error. @param {string} name the function that has failed */
  lastMessages(name) {
    return this.messages.splice(0).join("; ") || `${name} has failed`;
  }

  /** A view of the values of a group. The memory may move when it grows, so the view must not be kept. @param {Group} group */
  numbers({ base, values, indices }) {
    const { buffer } = this.functions.memory;
    return base === "Real" ? new Float64Array(buffer, values, indices.length) : new Int32Array(buffer, values, indices.length);
  }

  /** Takes bytes of the allocated memory; returns their address. @param {number} size */
  take(size) {
    const address = this.next;
    this.next += (size + 7) & ~7;
    return address;
  }

  /** Writes a string into the memory; returns its address. @param {string} text */
  put(text) {
    const bytes = new TextEncoder().encode(`${text}\0`);
    const address = this.take(bytes.length);
    new Uint8Array(this.functions.memory.buffer, address, bytes.length).set(bytes);
    return address;
  }

  /** The string at an address. @param {number} address */
  text(address) {
    const bytes = new Uint8Array(this.functions.memory.buffer, address);
    return new TextDecoder().decode(bytes.slice(0, bytes.indexOf(0)));
  }
}
