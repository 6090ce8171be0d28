/** The panel of what agents see: frames as pictures, other observations as numbers. */

import { make, panel, short } from "segar/elements.js";

export function seenPanel(page) {
  const boxes = page.about.sets[0].observations.map(() => make("figure"));
  const element = panel("What the agent sees", true, make("div", { className: "seen" }, ...boxes));

  function draw() {
    if (!element.open) return;
    page.world.about.observations.forEach((one, k) => {
      const seen = page.world.observe(k);
      if (one.dtype === "uint8" && one.shape.length === 3) frame(boxes[k], one, seen);
      else numbers(boxes[k], one, seen);
    });
  }

  element.addEventListener("toggle", draw);
  return { element, draw };
}

/** Frames side by side, the oldest first where several are stacked. */
function frame(box, { name, shape: [height, width, depth] }, bytes) {
  const colours = depth % 3 === 0 ? 3 : 1;
  const stacked = depth / colours;
  if (box.children.length !== stacked + 1) {
    const label = stacked > 1 ? `${name}: the last ${stacked} frames` : `${name}: ${width} × ${height} pixels`;
    const canvases = Array.from({ length: stacked }, () => make("canvas", { width, height, role: "img", "aria-label": `What the agent sees: ${name}` }));
    box.replaceChildren(...canvases, make("figcaption", { textContent: label }));
  }
  for (let s = 0; s < stacked; s++) {
    const context = box.children[s].getContext("2d");
    const image = context.createImageData(width, height);
    for (let i = 0; i < width * height; i++) {
      for (let c = 0; c < 3; c++) image.data[4 * i + c] = bytes[i * depth + s * colours + (colours === 3 ? c : 0)];
      image.data[4 * i + 3] = 255;
    }
    context.putImageData(image, 0, 0);
  }
}

function numbers(box, { name, shape }, seen) {
  const text = [...seen].map(short).join(", ");
  if (!box.firstChild) box.append(make("code"), make("figcaption", { textContent: `${name}: ${shape.join(" × ")} numbers` }));
  box.firstChild.textContent = text;
}
