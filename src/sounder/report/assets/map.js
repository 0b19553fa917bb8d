/* The map: metres, north up as y down; marks keep their size on the screen. */

const STEP = 1.4;

function drawMap(host, tools, { tip, choose, named }) {
  const { positions, reflectors, mpcs, outline } = data;
  const places = positions.flatMap((one) => [one.tx, one.rx]).concat(mpcs.point.filter(Boolean), reflectors.flatMap((one) => one.line));
  const [x, y] = [ends(places.map((one) => one[0])), ends(places.map((one) => -one[1]))];
  const whole = { x: x.min, y: y.min, width: x.max - x.min, height: y.max - y.min };
  const layers = {};
  const root = svg("svg", { role: "group", "aria-label": "Map of walls, poles, reflection points, TX and RX", preserveAspectRatio: "xMidYMid meet", style: `aspect-ratio: ${whole.width / whole.height}` });
  for (const name of ["outline", "pairs", "walls", "points", "antennas", "ellipses", "rays", "names"]) root.append((layers[name] = svg("g", { id: `layer-${name}` })));
  const marks = {};

  const dot = ([east, north]) => `M${east} ${-north}h0.0001`;
  const line = (points) => `M${points.map(([east, north]) => `${east} ${-north}`).join("L")}`;

  function mark(layer, kind, number, shape, path, label) {
    const key = `${kind}-${number}`;
    const act = () => choose(kind, number);
    const keyboard = kind === "mpc" ? {} : {
      tabindex: "0", role: "button", "aria-label": label,
      onkeydown: (event) => { if (event.key === "Enter" || event.key === " ") { event.preventDefault(); act(); } },
    };
    marks[key] = svg("path", {
      class: `mark ${shape}`, d: path, "data-key": key, ...keyboard,
      onclick: () => { if (!moved) act(); },
      onpointermove: (event) => showTip(tip(kind, number), event),
      onpointerleave: (event) => showTip("", event),
    });
    layer.append(marks[key]);
  }

  const oval = ([east, north], [a, b, angle]) => svg("ellipse", { class: "ellipse", rx: a, ry: b, transform: `translate(${east} ${-north}) rotate(${-angle})` });

  for (const segment of outline) layers.outline.append(svg("path", { class: "outline", d: line(segment) }));
  const transmitters = new Map();
  positions.forEach((one, i) => {
    layers.pairs.append(svg("path", { class: "pair", d: line([one.tx, one.rx]) }));
    const key = one.tx.join();
    if (!transmitters.has(key)) transmitters.set(key, []);
    transmitters.get(key).push(i);
    if (one.ellipse) layers.ellipses.append(oval(one.rx, one.ellipse));
  });
  mpcs.point.forEach((point, i) => {
    if (!point) return;
    mark(layers.points, "mpc", i, "rp", dot(point), "");
    if (mpcs.ellipse[i]) layers.ellipses.append(oval(point, mpcs.ellipse[i]));
  });
  reflectors.forEach((one, i) => {
    mark(layers.walls, "reflector", i, one.kind === "pole" ? "pole" : "wall", one.kind === "pole" ? dot(one.line[0]) : line(one.line), named("reflector", i));
    if (one.ellipse) layers.ellipses.append(oval(one.line[0], one.ellipse));
  });
  positions.forEach((one, i) => mark(layers.antennas, "position", i, "rx", dot(one.rx), named("position", i)));
  [...transmitters.values()].forEach((members, i) => mark(layers.antennas, "tx", i, "tx", dot(positions[members[0]].tx), `TX of ${members.length} positions`));

  const label = (point, text) => layers.names.append(svg("text", { class: "name", x: point[0], y: -point[1], dx: "0.6em", dy: "-0.4em" }, text));
  positions.forEach((one) => label(one.rx, one.name));
  reflectors.forEach((one, i) => label([0, 1].map((axis) => (one.line[Math.floor((one.line.length - 1) / 2)][axis] + one.line[Math.floor(one.line.length / 2)][axis]) / 2), String(i)));

  const scale = html("span", { class: "hint" });
  let view = { ...whole };
  function show() {
    root.setAttribute("viewBox", `${view.x} ${view.y} ${view.width} ${view.height}`);
    const pixel = Math.max(view.width / (root.clientWidth || 600), view.height / (root.clientHeight || 450));
    layers.names.setAttribute("font-size", 13 * pixel);
    const power = 10 ** Math.floor(Math.log10(120 * pixel));
    const length = power * [5, 2, 1].find((one) => one * power <= 120 * pixel);
    scale.textContent = `Bar: ${length} m`;
    bar.style.width = `${length / pixel}px`;
    thinNames(pixel);
  }
  /* Names that would lie over others are left out until the map is enlarged. */
  function thinNames(pixel) {
    const taken = [];
    for (const text of layers.names.children) {
      const [left, top] = [Number(text.getAttribute("x")), Number(text.getAttribute("y"))];
      const box = { left, top: top - 16 * pixel, right: left + (8 * text.textContent.length + 8) * pixel, bottom: top };
      const hidden = taken.some((one) => box.left < one.right && one.left < box.right && box.top < one.bottom && one.top < box.bottom);
      text.style.display = hidden ? "none" : "";
      if (!hidden) taken.push(box);
    }
  }
  function zoom(factor, fx = 0.5, fy = 0.5) {
    const [width, height] = [view.width / factor, view.height / factor];
    view = { x: view.x + (view.width - width) * fx, y: view.y + (view.height - height) * fy, width, height };
    show();
  }
  function pan(dx, dy) {
    view.x += dx;
    view.y += dy;
    show();
  }
  const at = (event) => {
    const matrix = root.getScreenCTM();
    const place = new DOMPoint(event.clientX, event.clientY).matrixTransform(matrix.inverse());
    return { fx: (place.x - view.x) / view.width, fy: (place.y - view.y) / view.height, metres: 1 / matrix.a };
  };

  const pointers = new Map();
  let moved = false;
  root.addEventListener("pointerdown", (event) => { if (!pointers.size) moved = false; pointers.set(event.pointerId, event); });
  root.addEventListener("pointermove", (event) => {
    const before = pointers.get(event.pointerId);
    if (!before) return;
    const [dx, dy] = [event.clientX - before.clientX, event.clientY - before.clientY];
    if (!moved && Math.hypot(dx, dy) < 4) return;
    moved = true;
    const { metres } = at(event);
    if (pointers.size === 1) {
      pan(-dx * metres, -dy * metres);
    } else {
      const other = [...pointers.values()].find((one) => one.pointerId !== event.pointerId);
      const apart = (one) => Math.hypot(one.clientX - other.clientX, one.clientY - other.clientY);
      const middle = at({ clientX: (event.clientX + other.clientX) / 2, clientY: (event.clientY + other.clientY) / 2 });
      zoom(apart(event) / Math.max(apart(before), 1), middle.fx, middle.fy);
    }
    pointers.set(event.pointerId, event);
  });
  for (const name of ["pointerup", "pointercancel", "pointerleave"]) root.addEventListener(name, (event) => pointers.delete(event.pointerId));
  root.addEventListener("wheel", (event) => {
    if (!event.ctrlKey && !event.metaKey) return;
    event.preventDefault();
    const { fx, fy } = at(event);
    zoom(STEP ** (-event.deltaY / 100), fx, fy);
  }, { passive: false });
  root.addEventListener("keydown", (event) => {
    const moves = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    if (moves[event.key]) pan((moves[event.key][0] * view.width) / 8, (moves[event.key][1] * view.height) / 8);
    else if (event.key === "+" || event.key === "-") zoom(event.key === "+" ? STEP : 1 / STEP);
    else return;
    event.preventDefault();
  });

  const bar = html("span", { style: "display: inline-block; height: 6px; background: #1a1a1a" });
  const north = html("span", { title: "direction of north", style: `display: inline-block; transform: rotate(${-data.north}deg)` }, "↑ N");
  const toggle = (name, text, on) => html("label", {}, html("input", {
    type: "checkbox", checked: on ? "" : null, style: "min-height: 0",
    onchange: (event) => { layers[name].style.display = event.target.checked ? "" : "none"; },
  }), ` ${text}`);
  layers.ellipses.style.display = "none";
  tools.append(
    button("+", () => zoom(STEP), { "aria-label": "Zoom in" }), button("−", () => zoom(1 / STEP), { "aria-label": "Zoom out" }),
    button("Whole map", () => { view = { ...whole }; show(); }),
    toggle("names", "names", true), toggle("pairs", "TX to RX", true), toggle("points", "reflection points", true), toggle("ellipses", "error ellipses", false),
    ...(outline.length ? [toggle("outline", "known outline", true)] : []),
    north, bar, scale,
  );
  host.append(root, html("div", { class: "legend" }, ...[["reflector", "--wall"], ["reflection point", "--rp"], ["RX", "--rx"], ["TX", "--tx"]].map(([text, name]) =>
    html("span", {}, html("span", { class: "swatch", style: `background: var(${name})` }), text))));
  show();
  window.addEventListener("resize", show);

  return {
    transmitters: [...transmitters.values()],
    /* Mark what is chosen, and draw its paths: [[east, north], ...] each. */
    highlight(keys, paths) {
      for (const one of Object.values(marks)) one.classList.remove("chosen");
      for (const key of keys) if (marks[key]) marks[key].classList.add("chosen");
      layers.rays.replaceChildren(...paths.map((path) => svg("path", { class: "ray", d: line(path) })));
    },
  };
}
