// The FMU: its model description, and its WebAssembly module behind the functions of FMI 2.0.

/**
 * A variable, as the model description has it. `factor` and `offset` turn its unit into `unit`, in which it is shown.
 * @typedef {{
 *   name: string, reference: number, description: string, causality: string, variability: string,
 *   type: string, start: string | null, min: number, max: number, nominal: number,
 *   unit: string, factor: number, offset: number, items: {name: string, value: number}[],
 * }} Variable
 */

/**
 * Variables that are read or set together: those of a base type, with their places in a list, and where in the
 * module's memory their references and values are.
 * @typedef {{base: "Real" | "Integer" | "Boolean", places: number[], references: number, values: number}} Group
 */

/**
 * An FMU as the page contains it: files are its resources by name.
 * @typedef {{description: Description, module: WebAssembly.Module, files: Map<string, Uint8Array>}} Package
 */

/**
 * What the module exports, besides the functions of FMI.
 * @typedef {Record<string, (...values: number[]) => number> & {memory: WebAssembly.Memory}} Exports
 */

/** What an FMU has refused, in its words. */
class Refusal extends Error {
  /** @param {string} message @param {number} [status] */
  constructor(message, status = 3) {
    super(message);
    this.status = status;
  }
}
/** The FMU has ended the run, by itself. */
class Ended extends Refusal {
  /** @param {number} time s */
  constructor(time) {
    super(`The FMU has ended the run at ${Number(time.toPrecision(6))} s.`);
    this.time = time;
  }
}

/** A status, and kinds of what is asked after it (FMI 2.0, section 4.2.3). */
const [DISCARD, LAST_SUCCESSFUL_TIME, TERMINATED] = [2, 2, 3];

class Description {
  /** @param {string} text modelDescription.xml of FMI 2.0 */
  constructor(text) {
    const root = new DOMParser().parseFromString(text, "text/xml").documentElement;
    /** @param {string} name */
    const of = (name) => root.getAttribute(name) || "";
    const experiment = root.querySelector("DefaultExperiment");
    /** @param {string} name @param {number} otherwise */
    const time = (name, otherwise) => Number(experiment?.getAttribute(name) || otherwise);
    this.name = of("modelName");
    this.description = of("description");
    this.guid = of("guid");
    this.version = of("version");
    this.identifier = root.querySelector("CoSimulation")?.getAttribute("modelIdentifier") || "";
    this.startTime = time("startTime", 0);
    this.stopTime = time("stopTime", this.startTime + 1);
    this.step = time("stepSize", (this.stopTime - this.startTime) / 1000);
    const types = new Map([...root.querySelectorAll("SimpleType")].map((type) => [type.getAttribute("name"), type]));
    const units = new Map([...root.querySelectorAll("UnitDefinitions > Unit")].map((unit) => [unit.getAttribute("name"), unit]));
    this.variables = [...root.querySelectorAll("ScalarVariable")].map((element) => variable(element, types, units));
    this.byName = new Map(this.variables.map((one) => [one.name, one]));
  }

  /** Those of a causality that are numbers. @param {string} causality */
  numbers(causality) {
    return this.variables.filter((one) => one.causality === causality && one.type !== "String");
  }
}

/** @param {Element} element @param {Map<string | null, Element>} types @param {Map<string | null, Element>} units */
function variable(element, types, units) {
  const value = /** @type {Element} */ (element.firstElementChild);
  const declared = types.get(value.getAttribute("declaredType"));
  /** @param {string} name */
  const of = (name) => value.getAttribute(name) ?? declared?.firstElementChild?.getAttribute(name) ?? null;
  /** @param {string} name @param {number} otherwise */
  const number = (name, otherwise) => (of(name) === null ? otherwise : Number(of(name)));
  const display = [...(units.get(of("unit"))?.querySelectorAll("DisplayUnit") || [])].find(
    (unit) => unit.getAttribute("name") === of("displayUnit"),
  );
  return {
    name: element.getAttribute("name") || "",
    reference: Number(element.getAttribute("valueReference")),
    description: element.getAttribute("description") || "",
    causality: element.getAttribute("causality") || "local",
    variability: element.getAttribute("variability") || "continuous",
    type: value.tagName,
    start: of("start"),
    min: number("min", -Infinity),
    max: number("max", Infinity),
    nominal: number("nominal", 1),
    unit: ((display ? of("displayUnit") : of("unit")) || "").replace(/^1$/, ""),
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

/** What the functions call the type. @param {Variable} one @returns {"Real" | "Integer" | "Boolean"} */
function baseOf(one) {
  return one.type === "Real" || one.type === "Boolean" ? one.type : "Integer";
}

/** An instance for Co-Simulation, in a module with a memory of its own. */
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
      this.next = this.functions.fmu_room(content.length + 4 * name.length + 64);
      const [path, place] = [this.put(`/resources/${name}`), this.take(content.length)];
      new Uint8Array(this.functions.memory.buffer, place, content.length).set(content);
      this.functions.fmu_file(path, place, content.length);
    }
    // Room for each variable in a few groups, and for texts.
    this.next = this.functions.fmu_room(8192 + 128 * description.variables.length);
    const texts = [description.identifier, description.guid, files.size ? "file:///resources" : ""];
    const [name, guid, resources] = texts.map((text) => this.put(text));
    const callbacks = this.take(20);
    new Uint8Array(this.functions.memory.buffer, callbacks, 20).fill(0);
    /** The instance, as the module knows it; 0 if there is none. */
    this.instance = this.functions.fmi2Instantiate(name, 1, guid, resources, callbacks, 0, 0);
    if (!this.instance) {
      throw new Refusal(this.said("fmi2Instantiate"));
    }
    this.isNew = true;
  }

  /** Goes to the start with these start values, and initializes. @param {Map<Variable, number | string>} start */
  begin(start) {
    if (!this.isNew) {
      this.call("fmi2Reset");
    }
    this.isNew = false;
    this.time = this.description.startTime;
    this.call("fmi2SetupExperiment", 0, 0, this.time, 0, 0);
    for (const [one, value] of start) {
      const here = this.next;
      if (typeof value === "string") {
        const [text, reference, place] = [this.put(value), this.take(4), this.take(4)];
        const words = new Uint32Array(this.functions.memory.buffer);
        [words[reference / 4], words[place / 4]] = [one.reference, text];
        this.call("fmi2SetString", reference, 1, place);
      } else {
        this.set(this.group([one]), [value]);
      }
      this.next = here;
    }
    this.call("fmi2EnterInitializationMode");
    this.call("fmi2ExitInitializationMode");
  }

  /** Room for variables, to set and get them by. @param {Variable[]} variables */
  group(variables) {
    return /** @type {Group["base"][]} */ (["Real", "Integer", "Boolean"]).flatMap((base) => {
      const places = [...variables.keys()].filter((place) => baseOf(variables[place]) === base);
      if (places.length === 0) {
        return [];
      }
      const [references, values] = [this.take(4 * places.length), this.take(8 * places.length)];
      const numbers = new Uint32Array(this.functions.memory.buffer, references, places.length);
      numbers.set(places.map((place) => variables[place].reference));
      return [{ base, places, references, values }];
    });
  }

  /** @param {Group[]} groups @param {ArrayLike<number>} values in the order of the variables */
  set(groups, values) {
    for (const group of groups) {
      const numbers = this.numbers(group);
      for (let k = 0; k < numbers.length; k++) {
        numbers[k] = values[group.places[k]];
      }
      this.call(`fmi2Set${group.base}`, group.references, numbers.length, group.values);
    }
  }

  /** @param {Group[]} groups @param {Float64Array} values in the order of the variables */
  get(groups, values) {
    for (const group of groups) {
      const { length } = group.places;
      this.call(`fmi2Get${group.base}`, group.references, length, group.values);
      const numbers = this.numbers(group);
      for (let k = 0; k < length; k++) {
        values[group.places[k]] = numbers[k];
      }
    }
  }

  /** A step to `time`, s. @param {number} time */
  stepTo(time) {
    try {
      this.call("fmi2DoStep", this.time, time - this.time, 1);
    } catch (refusal) {
      if (!(refusal instanceof Refusal && refusal.status === DISCARD)) {
        throw refusal;
      }
      const place = this.take(8);
      const { buffer } = this.functions.memory;
      if (this.functions.fmi2GetBooleanStatus(this.instance, TERMINATED, place) === 0 && new Int32Array(buffer, place, 1)[0]) {
        this.call("fmi2GetRealStatus", LAST_SUCCESSFUL_TIME, place);
        throw new Ended(new Float64Array(buffer, place, 1)[0]);
      }
      throw refusal;
    }
    this.time = time;
  }

  /** Calls a function of the instance; fails with what the FMU has said. @param {string} name @param {...number} values */
  call(name, ...values) {
    let status;
    try {
      status = this.functions[name](this.instance, ...values);
    } catch (trap) {
      throw trap instanceof WebAssembly.RuntimeError ? new Refusal(`${name}: the FMU has failed: ${trap.message}`) : trap;
    }
    if (status > 1) {
      throw new Refusal(this.said(name), status);
    }
  }

  /** The messages since the last one. @param {string} name of the function that has failed */
  said(name) {
    return this.messages.splice(0).join("; ") || `${name} has failed`;
  }

  /** The values of a group, as the memory has them now: it moves when it grows. @param {Group} group */
  numbers({ base, values, places }) {
    const { buffer } = this.functions.memory;
    return base === "Real" ? new Float64Array(buffer, values, places.length) : new Int32Array(buffer, values, places.length);
  }

  /** So many bytes of the room. @param {number} size */
  take(size) {
    const here = this.next;
    this.next += (size + 7) & ~7;
    return here;
  }

  /** A text in the room. @param {string} text */
  put(text) {
    const bytes = new TextEncoder().encode(`${text}\0`);
    const here = this.take(bytes.length);
    new Uint8Array(this.functions.memory.buffer, here, bytes.length).set(bytes);
    return here;
  }

  /** @param {number} place of a text */
  text(place) {
    const bytes = new Uint8Array(this.functions.memory.buffer, place);
    return new TextDecoder().decode(bytes.slice(0, bytes.indexOf(0)));
  }
}
