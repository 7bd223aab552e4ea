"use strict";
// What the scripts share. Text from the run only ever becomes text, never markup.
const readData = (id) => {
  const node = document.getElementById(id);
  return node === null ? null : JSON.parse(node.textContent);
};
const make = (tag, properties = {}, ...children) => {
  const node = Object.assign(document.createElement(tag), properties);
  node.append(...children);
  return node;
};
const fill = (select, entries) => {
  select.replaceChildren(...entries.map(([value, text]) => new Option(text, value)));
};
