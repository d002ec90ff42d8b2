// Sliders and number fields for variables.

/** Returns a unit as it is printed: N·m/° for N.m/deg. @param {string} unit */
function printed(unit) {
  return unit.replaceAll(".", "\u00b7").replace(/\bdeg(?=C?\b)/g, "\u00b0").replace(/(?<=[a-z])2\b/g, "\u00b2");
}

/** Returns a number with its unit: 1.4 N·m/°, 20°. @param {number} value @param {string} unit */
function quantity(value, unit) {
  const short = Number(value.toPrecision(6));
  const [number, text] = [(Math.abs(short) >= 1e6 ? short.toExponential().replace("e+", "e") : String(short)).replace("-", "\u2212"), printed(unit)];
  return text ? `${number}${text === "\u00b0" ? "" : "\u00a0"}${text}` : number;
}

/** Returns the range of a variable in the unit of the page, to be put after "must be"; "" if all numbers are possible. @param {Variable} one */
function rangeOf(one) {
  const [least, most] = [one.min, one.max].map((value) => value * one.factor + one.offset);
  // A tiny minimum means that the number must be positive.
  const isPositive = least > 0 && least < 1e-200;
  const low = isPositive ? `greater than ${quantity(0, one.unit)}` : `at least ${quantity(least, one.unit)}`;
  if (Number.isFinite(most)) {
    return Number.isFinite(least) && !isPositive ? `from ${quantity(least, "")} to ${quantity(most, one.unit)}` : `at most ${quantity(most, one.unit)}`;
  }
  return Number.isFinite(least) ? low : "";
}

/** Returns the reason why a variable cannot have a value; "" if it can. @param {Variable} one @param {number | string} value @param {string} [label] of its field */
function problem(one, value, label = one.name) {
  if (one.type === "String") {
    return "";
  }
  const number = Number(value);
  if (value === "" || !Number.isFinite(number)) {
    return `${label} must be a number`;
  }
  const given = quantity(number * one.factor + one.offset, one.unit);
  if (one.type !== "Real" && !(Number.isInteger(number) && Math.abs(number) < 2 ** 31)) {
    return `${label} must be an integer below 2\u00b3\u00b9, but it is ${given}`;
  }
  // The user sees the limits in the unit of the page, whose conversion may change the last digit.
  const tolerance = 1e-12 * Math.abs(number);
  return number < one.min - tolerance || number > one.max + tolerance ? `${label} must be ${rangeOf(one)}, but it is ${given}` : "";
}

/** Rounds a positive number up to 1, 2 or 5 times a power of ten. @param {number} value */
function roundAbove(value) {
  const power = 10 ** Math.floor(Math.log10(value) + 1e-12);
  return power * ([1, 2, 5].find((factor) => factor * power >= value * (1 - 1e-9)) || 10);
}

/** Rows with a slider and a number field for variables, in the units of the page. */
class Fields {
  /** @param {(one: Variable, value: number | string) => void} changed called with values that the type allows @param {(reason: string) => void} rejected called with the reason why a value is impossible */
  constructor(changed, rejected = () => {}) {
    this.changed = changed;
    this.rejected = rejected;
    /** Functions that show the value of a variable. @type {Map<string, (value: number | string) => void>} */
    this.show = new Map();
    /** Functions that mark the field of a variable as invalid with a message, or as valid with "". @type {Map<string, (message: string) => void>} */
    this.mark = new Map();
    /** The labels of the fields, by variable. @type {Map<string, string>} */
    this.labels = new Map();
    /** Largest absolute values that a field accepts, by variable. @type {Map<string, number>} */
    this.reaches = new Map();
  }

  /** Calls `changed`, or marks the field as invalid if the value is impossible. @param {Variable} one @param {number | string} value */
  change(one, value) {
    const reason = this.problem(one, value);
    this.mark.get(one.name)?.(reason);
    if (reason) {
      this.rejected(reason);
    } else {
      this.changed(one, value);
    }
  }

  /** Returns the reason why a field cannot have a value, with the label of the field; "" if it can. @param {Variable} one @param {number | string} value */
  problem(one, value) {
    const label = this.labels.get(one.name) || one.name;
    const reach = this.reaches.get(one.name);
    const reason = problem(one, value, label);
    return reason || !reach || Math.abs(Number(value)) <= reach ? reason : `${label} must be from ${quantity(-reach * one.factor, "")} to ${quantity(reach * one.factor, one.unit)}, but it is ${quantity(Number(value) * one.factor, one.unit)}`;
  }

  /** Returns the element below a field that shows why its value is invalid. @param {Variable} one @param {HTMLElement} field @returns {HTMLElement} */
  message(one, field) {
    const id = `${field.id}-message`;
    const message = element("span", { id, class: "live-message", role: "alert" });
    this.mark.set(one.name, (text) => {
      message.textContent = text;
      field.toggleAttribute("aria-invalid", text !== "");
      field.toggleAttribute("aria-describedby", text !== "");
      if (text) {
        field.setAttribute("aria-invalid", "true");
        field.setAttribute("aria-describedby", id);
      }
    });
    return message;
  }

  /** Returns the row of a variable. @param {Variable} one @param {string} label @param {[number, number] | null} ends of the slider; `null` derives them from min, max and start @param {string} [about] */
  row(one, label, ends, about = one.description) {
    const id = `live-${one.name.replace(/\W/g, "-")}`;
    this.labels.set(one.name, label);
    const name = element("label", { for: id }, element("b", {}, label), about ? ` ${about}` : "");
    if (one.type === "Real" || (one.type === "Integer" && !ends)) {
      return this.number(one, id, name, ends);
    }
    if (one.type === "Enumeration") {
      const list = element("select", { id }, ...one.items.map((item) => element("option", { value: String(item.value) }, item.name)));
      list.addEventListener("change", () => this.change(one, Number(list.value)));
      this.show.set(one.name, (value) => (list.value = String(value)));
      return element("div", { class: "live-row" }, name, list, this.message(one, list));
    }
    const kind = one.type === "Boolean" ? "checkbox" : one.type === "String" ? "text" : "number";
    const field = element("input", { id, type: kind });
    field.addEventListener("change", () => this.change(one, kind === "checkbox" ? Number(field.checked) : kind === "text" ? field.value : Number(field.value)));
    this.show.set(one.name, (value) => {
      field.checked = Number(value) !== 0;
      field.value = String(value);
    });
    return element("div", { class: "live-row" }, name, field, this.message(one, field));
  }

  /** @param {Variable} one @param {string} id @param {HTMLElement} name @param {[number, number] | null} ends */
  number(one, id, name, ends) {
    const { factor, offset, type } = one;
    const start = startOf(one) * factor + offset;
    const isInteger = type !== "Real";
    const [least, most] = [one.min * factor + offset, one.max * factor + offset];
    // A Real that cannot be negative and starts above 0 has a logarithmic slider, from a tenth of its start value to ten times that value.
    const isLog = !ends && !isInteger && least >= 0 && start > 0;
    const size = roundAbove(Math.max(Math.abs(start), Math.abs(one.nominal * factor)));
    const [low, high] = ends || (isLog ? [start / 10, start * 10] : isInteger ? [start - size, start + 2 * size] : [Math.min(-size, start), Math.max(size, start)]);
    const [begin, end] = [Math.max(low, least), Math.min(high, most)];
    const digits = Math.max(0, 4 - Math.floor(Math.log10(end - begin)));
    const toShare = (/** @type {number} */ value) => (isLog ? Math.log(Math.max(value, 1e-300) / begin) / Math.log(end / begin) : (value - begin) / (end - begin));
    const fromShare = (/** @type {number} */ share) => (isLog ? begin * (end / begin) ** share : begin + share * (end - begin));
    const slider = element("input", { type: "range", min: "0", max: "1", step: isInteger ? String(1 / (end - begin)) : "0.001", "aria-labelledby": `${id}-label` });
    name.firstElementChild?.setAttribute("id", `${id}-label`);
    const field = element("input", { id, type: "number", step: isInteger ? "1" : "any" });
    const show = (/** @type {number} */ value) => {
      const text = String(ends ? Number(value.toFixed(digits)) : Number(value.toPrecision(6)));
      slider.value = String(toShare(value));
      slider.setAttribute("aria-valuetext", `${text} ${printed(one.unit)}`);
      // Does not overwrite what the user is typing.
      if (document.activeElement !== field) {
        field.value = text;
      }
    };
    const change = (/** @type {number} */ value) => this.change(one, Math.abs(value - start) <= 1e-12 * Math.abs(start) ? startOf(one) : (value - offset) / factor);
    slider.addEventListener("input", () => {
      const value = Number(slider.value) === Number(toShare(start).toFixed(3)) ? start : fromShare(Number(slider.value));
      const round = isInteger ? Math.round(value) : Number(value.toPrecision(3));
      last = round;
      show(round);
      change(round);
    });
    let last = start;
    field.addEventListener("change", () => {
      last = field.value === "" ? last : Number(field.value);
      field.value = String(last);
      show(last);
      change(last);
    });
    field.addEventListener("focus", () => field.select());
    field.addEventListener("blur", () => show(last));
    this.show.set(one.name, (value) => show((last = Number(value) * factor + offset)));
    const round = (/** @type {number} */ value) => quantity(value, "");
    const hint = Number.isFinite(most) ? `${round(least)} to ${round(most)}` : least > 0 && least < 1e-200 ? "> 0" : Number.isFinite(least) ? `\u2265 ${round(least)}` : "";
    const unit = element("span", { class: "live-unit" }, printed(one.unit), hint ? element("small", {}, ` ${hint}`) : "");
    return element("div", { class: "live-row" }, name, slider, field, unit, this.message(one, field));
  }
}
