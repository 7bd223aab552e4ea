"use strict";
// The scene picker: every scene's numbers, and pictures of those that have them.
(() => {
  const data = readData("scenes-data");
  if (data === null) return;
  const element = (id) => document.getElementById(id);
  const picker = element("scene-picker");
  const number = (value) => (value === null ? "\u2013" : (value / 1000).toFixed(3));
  const groups = new Map();
  data.scenes.forEach((scene, index) => {
    if (!groups.has(scene.group)) groups.set(scene.group, []);
    groups.get(scene.group).push(new Option(scene.id, index));
  });
  for (const [label, entries] of groups) picker.append(make("optgroup", { label }, ...entries));

  const thumbs = [];
  data.scenes.forEach((scene, index) => {
    const [first] = data.pictures[scene.id] ?? [];
    if (first === undefined) return;
    const image = make("img", { src: first.data, alt: "" });
    const button = make("button", { type: "button" }, image, `${scene.id} (${scene.group})`);
    button.addEventListener("click", () => show(index));
    thumbs.push([index, button]);
    element("scene-thumbs").append(button);
  });

  const numbers = (scene) => {
    const names = ["model", "test points", ...data.measures];
    const head = make("tr", {}, ...names.map((text, column) => make("th", {
      scope: "col", textContent: text, className: column > 1 ? "number" : "",
    })));
    const rows = scene.rows.map(([model, set, failure, ...values]) => make("tr", {},
      make("th", { scope: "row", textContent: data.models[model] }),
      make("td", { textContent: data.sets[set] }),
      ...(failure === null
        ? values.map((value) => make("td", { className: "number", textContent: number(value) }))
        : [make("td", {
          colSpan: data.measures.length, className: "bad long",
          textContent: `failed: ${data.failures[failure]}`,
        })])));
    const caption = make("caption", {}, make("span", { textContent: `Numbers of ${scene.id}` }));
    return make("table", {}, caption, make("thead", {}, head), make("tbody", {}, ...rows));
  };

  function show(index) {
    const scene = data.scenes[index];
    picker.value = index;
    for (const [other, button] of thumbs) button.setAttribute("aria-pressed", String(other === index));
    element("scene-before").disabled = index === 0;
    element("scene-after").disabled = index === data.scenes.length - 1;
    element("scene-title").textContent = scene.id;
    element("scene-about").textContent = scene.about;
    element("scene-numbers").replaceChildren(numbers(scene));
    const pictures = data.pictures[scene.id];
    element("scene-pictures").replaceChildren(...(pictures ?? []).map((item) => make("figure", {},
      make("img", { src: item.data, alt: item.caption }),
      make("figcaption", { textContent: item.caption }))));
    element("scene-unpictured").textContent = pictures === undefined ? data.unpictured : "";
  }
  picker.addEventListener("change", () => show(Number(picker.value)));
  element("scene-before").addEventListener("click", () => show(Number(picker.value) - 1));
  element("scene-after").addEventListener("click", () => show(Number(picker.value) + 1));
  show(0);
})();
