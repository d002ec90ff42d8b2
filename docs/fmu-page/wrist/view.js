// The wrist as the view of a page that runs an FMU: the image, and controls for what it shows.

/** The time at which the wrist is farthest from where it starts, s. @param {Table} table */
function farthest(table) {
  const [pitch, roll] = ["pitch", "roll"].map((name) => table.column(name));
  let most = 0;
  for (let row = 1; row < table.count; row++) {
    most = Math.abs(pitch[row]) + Math.abs(roll[row]) > Math.abs(pitch[most]) + Math.abs(roll[most]) ? row : most;
  }
  return table.column("time")[most];
}

/**
 * The view. `stiffness` names the parameter of the couplings next to the wrist. Its function `set` takes the numbers of lobes and rollers from the parameters M and N.
 * @param {Move} move @param {("motors" | "gripper")[]} handles parts that can be dragged @param {(speed: number) => void} pace sets the speed of the run
 */
function wristView(move, handles, pace, stiffness = "") {
  // From the front and from above, so that pitch moves the gripper down and up, as the pointer that drags it.
  const wrist = new Wrist({ ...WRIST, azimuth: -82, elevation: 24 }, move, handles);
  const inside = element("button", { type: "button", "aria-pressed": "false" }, "Look inside");
  const look = (/** @type {Focus} */ focus) => {
    inside.setAttribute("aria-pressed", String(focus === "torques"));
    wrist.look(focus);
  };
  inside.addEventListener("click", () => {
    look(wrist.focus === "torques" ? "" : "torques");
    pace(wrist.focus ? 0.2 : 1);
  });
  const boxes = Object.entries(PARTS_SHOWN).map(([part, label]) => {
    const box = element("input", { type: "checkbox", checked: "", "data-part": part });
    box.addEventListener("change", () => wrist.show(part, box.checked));
    return { box, part, row: element("label", {}, box, ` ${label}`) };
  });
  const twist = element("select", {}, element("option", { value: "0" }, "automatic"), ...["1", "5", "20", "50", "100"].map((value) => element("option", { value }, `\u00d7 ${value}`)));
  twist.addEventListener("change", () => wrist.enlarge(Number(twist.value)));
  const parts = element(
    "details", { class: "live-parts" }, element("summary", {}, "Parts"),
    element("div", { class: "live-buttons" }, ...boxes.map(({ row }) => row), element("label", {}, "twist of the couplings ", twist)),
  );
  const off = () => boxes.filter(({ box }) => !box.checked).map(({ part }) => part).join(" ");
  /** @type {Map<string, Setting>} */
  const settings = new Map([
    ["twist", { preset: "0", value: () => twist.value, set: (value) => {
      if (![...twist.options].some((option) => option.value === value)) {
        return false;
      }
      twist.value = value;
      wrist.enlarge(Number(value));
      return true;
    } }],
    ["look", { preset: "", value: () => wrist.focus, set: (value) => {
      const isKnown = !value || value in CLOSE;
      if (isKnown && value !== wrist.focus) {
        look(/** @type {Focus} */ (value));
      }
      return isKnown;
    } }],
    ["off", { preset: "", value: off, set: (value) => {
      const names = value ? value.split(" ") : [];
      boxes.forEach(({ box, part }) => {
        box.checked = !names.includes(part);
        wrist.show(part, box.checked);
      });
      return names.every((name) => name in PARTS_SHOWN);
    } }],
  ]);
  return {
    element: wrist.element,
    draw: (/** @type {Table} */ table, /** @type {number} */ time, caption = "") => {
      wrist.caption = caption;
      wrist.draw(table, time);
    },
    rest: farthest,
    set: (/** @type {(name: string) => number} */ parameter) => {
      wrist.stiffness = stiffness ? parameter(stiffness) : 0;
      wrist.count(parameter("M"), parameter("N"));
    },
    controls: [inside, parts],
    settings,
  };
}
