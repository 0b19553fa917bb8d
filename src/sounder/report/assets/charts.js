/* Charts: lines, dots and an image over two axes. */

const DASHES = { undefined: "solid", null: "solid", "6 4": "dashed", "2 3": "dotted" };
const GROUPS = { yes: ["LoS", "#0062a3"], no: ["NLoS", "#b84d00"], "not known": ["unknown", "#5a5a5a"] };

/* Round values between two ends: steps of 1, 2, 5 times a power of ten; decades with 2 and 5 on logarithmic axes that are long enough. */
function ticks(min, max, count, log, fixed) {
  const found = [];
  if (log) {
    for (let power = Math.floor(Math.log10(min)); 10 ** power <= max; power += 1) {
      for (const digit of [1, 2, 5]) if (digit * 10 ** power >= min && digit * 10 ** power <= max) found.push(digit * 10 ** power);
    }
    if (found.length > 2) return found;
    found.length = 0;
  }
  const raw = (max - min) / count;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = fixed || power * [1, 2, 5, 10].find((one) => one * power >= raw);
  for (let i = Math.ceil(min / step); i * step <= max + step / 1e6; i += 1) found.push(Number((i * step).toPrecision(10)));
  return found;
}

/*
 * Draw a chart into an element.
 *   title: text; x, y: {title, min, max, log, step}; image: {href, x: [from, to], y: [from, to]}
 *   series: [{name, colour, line, dash, dots, points: [[x, y, error]], tips: [text], pick: (i) => ...}]
 */
function chart(host, { title, x, y, image = null, series = [], legend = true }) {
  const width = Math.max(300, Math.min(host.clientWidth || 640, 720));
  const height = Math.round(Math.max(240, width * 0.58));
  const box = { left: 62, right: width - 12, top: 10, bottom: height - 46 };
  const along = (axis, from, to) => {
    const map = axis.log ? Math.log10 : (value) => value;
    const [low, high] = [map(axis.min), map(axis.max)];
    return (value) => from + ((map(value) - low) / (high - low || 1)) * (to - from);
  };
  const [toX, toY] = [along(x, box.left, box.right), along(y, box.bottom, box.top)];
  const id = `clip-${host.id || host.dataset.number}`;
  const drawing = svg("svg", { viewBox: `0 0 ${width} ${height}`, width, height, role: "img", "aria-label": title });
  drawing.append(svg("clipPath", { id }, svg("rect", { x: box.left, y: box.top, width: box.right - box.left, height: box.bottom - box.top })));
  for (const value of ticks(x.min, x.max, Math.floor(width / 90), x.log)) {
    drawing.append(
      svg("line", { class: "grid", x1: toX(value), x2: toX(value), y1: box.top, y2: box.bottom }),
      svg("text", { x: toX(value), y: box.bottom + 18, "text-anchor": "middle", "font-size": 13 }, String(value)),
    );
  }
  for (const value of ticks(y.min, y.max, 6, y.log, y.step)) {
    drawing.append(
      svg("line", { class: "grid", x1: box.left, x2: box.right, y1: toY(value), y2: toY(value) }),
      svg("text", { x: box.left - 6, y: toY(value) + 4, "text-anchor": "end", "font-size": 13 }, String(value)),
    );
  }
  const inside = svg("g", { "clip-path": `url(#${id})` });
  if (image) {
    const [left, right, top, bottom] = [toX(image.x[0]), toX(image.x[1]), toY(image.y[1]), toY(image.y[0])];
    inside.append(svg("image", { href: image.href, x: left, y: top, width: right - left, height: bottom - top, preserveAspectRatio: "none", style: "image-rendering: pixelated" }));
  }
  for (const one of series) {
    const shown = one.points.map(([px, py]) => px !== null && py !== null && (!x.log || px > 0));
    if (one.line) {
      let path = "";
      one.points.forEach(([px, py], i) => { if (shown[i]) path += `${i && shown[i - 1] ? "L" : "M"}${toX(px).toFixed(1)} ${toY(py).toFixed(1)}`; });
      inside.append(svg("path", { d: path, fill: "none", stroke: one.colour, "stroke-width": one.width || 1.6, "stroke-dasharray": one.dash }));
    }
    if (one.dots) {
      one.points.forEach(([px, py, error], i) => {
        if (!shown[i]) return;
        if (error) inside.append(svg("line", { x1: toX(px), x2: toX(px), y1: toY(py - error), y2: toY(py + error), stroke: one.colour }));
        inside.append(svg("circle", {
          cx: toX(px), cy: toY(py), r: 4.5, fill: one.hollow ? "none" : one.colour, stroke: one.hollow ? one.colour : "#fff", "stroke-width": one.hollow ? 2 : 1,
          "pointer-events": "all", style: one.pick ? "cursor: pointer" : null,
          onpointermove: (event) => showTip(one.tips ? one.tips[i] : `${px}, ${py}`, event),
          onpointerleave: (event) => showTip("", event),
          onclick: () => one.pick && one.pick(i),
        }));
      });
    }
  }
  drawing.append(
    inside,
    svg("rect", { class: "axis", x: box.left, y: box.top, width: box.right - box.left, height: box.bottom - box.top, "pointer-events": "none" }),
    svg("text", { x: (box.left + box.right) / 2, y: height - 8, "text-anchor": "middle", "font-size": 13 }, x.title),
    svg("text", { transform: `translate(14 ${(box.top + box.bottom) / 2}) rotate(-90)`, "text-anchor": "middle", "font-size": 13 }, y.title),
  );
  const entries = series.filter((one) => one.name && legend).map((one) =>
    html("span", {}, html("span", { class: one.dots ? "swatch" : `swatch stroke ${DASHES[one.dash]}`, style: `background: ${one.hollow ? "#fff" : one.colour}; color: ${one.colour}` }), one.name));
  host.replaceChildren(html("figure", { class: "chart" }, html("figcaption", {}, title), drawing, html("div", { class: "legend" }, ...entries)));
}

/* Ends of an axis with a margin, from the finite ones of some values. */
function ends(values, margin = 0.06) {
  const known = values.filter((value) => Number.isFinite(value));
  if (!known.length) return { min: 0, max: 1 };
  const [low, high] = [known.reduce((a, b) => Math.min(a, b)), known.reduce((a, b) => Math.max(a, b))];
  const room = (high - low || 1) * margin;
  return { min: low - room, max: high + room };
}
