// The wrist as the view of a page that runs an FMU: the image, and controls for what it shows.

/**
 * The view. Its function `set` takes the numbers of lobes and rollers from the parameters M and N.
 * @param {Move} move @param {("motors" | "gripper")[]} handles parts that can be dragged @param {(speed: number) => void} pace sets the speed of the run
 */
function wristView(move, handles, pace) {
  // From the front and from above, so that pitch moves the gripper down and up, as the pointer that drags it.
  const wrist = new Wrist({ ...WRIST, azimuth: -82, elevation: 24 }, move, handles);
  const inside = element("button", { type: "button", "aria-pressed": "false" }, "Look inside");
  const lookInside = (/** @type {boolean} */ isInside) => {
    inside.setAttribute("aria-pressed", String(isInside));
    wrist.lookInside(isInside);
  };
  inside.addEventListener("click", () => {
    lookInside(!wrist.isInside);
    pace(wrist.isInside ? 0.2 : 1);
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
    ["inside", { preset: "0", value: () => String(Number(wrist.isInside)), set: (value) => {
      if (value !== String(Number(wrist.isInside))) {
        lookInside(value === "1");
      }
      return value === "0" || value === "1";
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
    set: (/** @type {(name: string) => number} */ parameter) => wrist.count(parameter("M"), parameter("N")),
    controls: [inside, parts],
    settings,
  };
}
