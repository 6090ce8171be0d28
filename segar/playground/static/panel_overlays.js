/** The panel of what is drawn over the arena. */

import { make, panel } from "segar/elements.js";

const OVERLAYS = [
  ["velocity", "velocities"], ["force", "accelerations (mean of the last step)"], ["heat", "heat"], ["friction", "friction"],
  ["names", "names"],
];

export function overlaysPanel(page) {
  const boxes = OVERLAYS.map(([name, says]) => {
    const box = make("input", { type: "checkbox", checked: page.scene.overlays.has(name) });
    box.addEventListener("change", () => {
      if (box.checked) page.scene.overlays.add(name);
      else page.scene.overlays.delete(name);
      page.refresh();
    });
    return make("label", {}, box, ` ${says} `);
  });
  return { element: panel("Overlays", false, ...boxes) };
}
