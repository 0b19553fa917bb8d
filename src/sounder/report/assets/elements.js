"use strict";

/* Elements. Texts are set as text nodes: nothing of a user's file becomes markup. */

const data = JSON.parse(document.getElementById("data").textContent);

const byId = (id) => document.getElementById(id);

function build(node, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else if (value !== null && value !== undefined && value !== false) node.setAttribute(name, value);
  }
  node.append(...children.filter((child) => child !== null));
  return node;
}

const html = (name, attributes = {}, ...children) => build(document.createElement(name), attributes, children);

const svg = (name, attributes = {}, ...children) =>
  build(document.createElementNS("http://www.w3.org/2000/svg", name), attributes, children);

const button = (text, action, attributes = {}) => html("button", { type: "button", onclick: action, ...attributes }, text);

const list = (pairs) => html("dl", {}, ...pairs.flatMap(([label, value]) => [html("dt", {}, label), html("dd", {}, value)]));

/* Numbers as people read them. */

function number(value, digits) {
  return value === null || value === undefined ? "–" : value.toFixed(digits);
}

/* A value and its standard deviation, to the second digit of the latter. */
function withError(value, std, digits = 2) {
  if (value === null || value === undefined) return "–";
  if (!(std > 0)) return number(value, digits);
  const places = Math.min(Math.max(1 - Math.floor(Math.log10(std)), 0), 4);
  return `${value.toFixed(places)} ± ${std.toFixed(places)}`;
}

/* Text that follows the pointer. The same text is in the details of what is chosen. */
const tooltip = html("div", { class: "tooltip", hidden: "" });
document.body.append(tooltip);

function showTip(text, event) {
  tooltip.textContent = text;
  tooltip.hidden = !text;
  tooltip.style.left = `${Math.min(event.clientX + 12, window.innerWidth - 200)}px`;
  tooltip.style.top = `${event.clientY + 14}px`;
}
