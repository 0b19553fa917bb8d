/* What is chosen, and what the parts of the page show of it. */

const { positions, mpcs, reflectors } = data;
const ofPosition = positions.map(() => []);
const ofReflector = reflectors.map(() => []);
mpcs.position.forEach((position, i) => {
  if (position >= 0) ofPosition[position].push(i);
  if (mpcs.reflector[i] >= 0) ofReflector[mpcs.reflector[i]].push(i);
});
let chosen = 0;

const positionName = (i) => (positions[i] ? positions[i].name : "unknown");
const reflectorName = (i) => `${reflectors[i].kind} ${i}`;
const useOf = (i) => (mpcs.reflector[i] >= 0 ? reflectorName(mpcs.reflector[i]) : mpcs.uses[mpcs.use[i]]);
const mpcName = (i) => `MPC of ${positionName(mpcs.position[i])}, ${number(mpcs.delay[i], 1)} ns, ${number(mpcs.azimuth[i], 1)}°, ${number(mpcs.path_gain[i], 1)} dB`;
const place = (point) => point.map((value) => number(value, 2)).join(", ");
const error = (one) => (one ? `${number(one[0], 3)} m by ${number(one[1], 3)} m (half axes, 95 %), first at ${number(one[2], 0)}°` : "not known");

function named(kind, i) {
  if (kind === "position") return `${positionName(i)}: RX, line of sight ${positions[i].los}, ${ofPosition[i].length} MPCs`;
  if (kind === "reflector") return `${reflectorName(i)}, ${ofReflector[i].length} MPCs`;
  if (kind === "tx") return `TX of ${map.transmitters[i].map(positionName).join(", ")}`;
  return `${mpcName(i)}: ${useOf(i)}`;
}

const links = (members, kind, text) => html("ul", {}, ...members.map((i) => html("li", {}, button(text(i), () => choose(kind, i), { class: "link" }))));

function pathOf(i) {
  const { tx, rx } = positions[mpcs.position[i]];
  return mpcs.point[i] ? [tx, mpcs.point[i], rx] : [tx, rx];
}

function reflectorDetails(i) {
  const one = reflectors[i];
  const members = ofReflector[i];
  const last = one.line[one.line.length - 1];
  const run = [["from, to", `${place(one.line[0])} to ${place(last)} m`], ["length", `${number(one.length, 1)} m`]];
  const round = [["centre", `${place(one.centre)} m`], ["radius", `${withError(one.radius, one.radius_std)} m`]];
  const shape = {
    wall: [["normal", `${withError(one.normal, one.normal_std)}°`], ["offset", `${withError(one.offset, one.offset_std, 3)} m`], ...run],
    pole: [...round, ["error", error(one.ellipse)]],
    arc: [...round, ...run],
  }[one.kind];
  const pairs = new Set(members.map((k) => mpcs.position[k])).size;
  return {
    title: reflectorName(i), keys: [`reflector-${i}`, ...members.map((k) => `mpc-${k}`), ...members.map((k) => `position-${mpcs.position[k]}`)], paths: members.filter((k) => mpcs.point[k]).map(pathOf),
    facts: [...shape, ["height", `${number(one.base, 1)} to ${number(one.top, 1)} m`], ["material", one.material], ["seen by", `${members.length} MPCs of ${pairs} antenna pairs`]],
    list: links(members, "mpc", mpcName),
  };
}

function mpcDetails(i) {
  const p = mpcs.position[i];
  return {
    title: mpcName(i), keys: [`mpc-${i}`, `position-${p}`, `reflector-${mpcs.reflector[i]}`], paths: mpcs.point[i] ? [pathOf(i)] : [],
    facts: [
      ["antenna pair", `TX at ${place(positions[p].tx)} m, ${positionName(p)} at ${place(positions[p].rx)} m`],
      ["delay", `${withError(mpcs.delay[i], mpcs.delay_std[i])} ns`], ["azimuth", `${withError(mpcs.azimuth[i], mpcs.azimuth_std[i])}°`],
      ["elevation", `${withError(mpcs.elevation[i], mpcs.elevation_std[i])}°`], ["path gain", `${withError(mpcs.path_gain[i], mpcs.path_gain_std[i])} dB`],
      ["use", useOf(i)], ["reflection loss", `${number(mpcs.loss[i], 1)} dB`],
      ...(mpcs.point[i] ? [["reflection point", `${place(mpcs.point[i])} m`], ["error", error(mpcs.ellipse[i])]] : []),
    ],
    list: html("div", {}, links([p], "position", positionName), ...(mpcs.reflector[i] >= 0 ? [links([mpcs.reflector[i]], "reflector", reflectorName)] : [])),
  };
}

function positionFacts(i) {
  const one = positions[i];
  return [
    ["line of sight", one.los], ["RX", `${place(one.rx)} m`], ["TX", `${place(one.tx)} m`], ["distance", `${number(one.distance, 2)} m`],
    ["MPCs", `${ofPosition[i].length}, ${ofPosition[i].filter((k) => mpcs.reflector[k] >= 0).length} of them on reflectors`],
    ["directions", `${one.missing} missing, ${one.problems} with problems`], ["product", one.file],
    ...(one.ellipse ? [["error of the position", error(one.ellipse)]] : []),
    ...one.failures.map((text) => ["failure", text]), ...one.notes.map((text) => ["note", text]),
  ];
}

function details(kind, i) {
  if (kind === "reflector") return reflectorDetails(i);
  if (kind === "mpc") return mpcDetails(i);
  if (kind === "tx") {
    const members = map.transmitters[i];
    return { title: "TX", keys: [`tx-${i}`, ...members.map((k) => `position-${k}`)], paths: members.map((k) => [positions[k].tx, positions[k].rx]), facts: [["TX", `${place(positions[members[0]].tx)} m`]], list: links(members, "position", positionName) };
  }
  const members = ofPosition[i];
  return { title: positionName(i), keys: [`position-${i}`, ...members.map((k) => `mpc-${k}`), ...members.map((k) => `reflector-${mpcs.reflector[k]}`)], paths: members.filter((k) => mpcs.point[k]).map(pathOf), facts: positionFacts(i), list: links(members, "mpc", mpcName) };
}

function choose(kind, i) {
  const { title, facts, list: members, keys, paths } = details(kind, i);
  byId("details").replaceChildren(html("h3", {}, title), list(facts), members);
  map.highlight(keys, paths);
  if (kind === "position") showPosition(i);
  if (kind === "mpc") showPosition(mpcs.position[i], i);
}

function showPosition(i, mpc = null) {
  chosen = i;
  const { name, daps, pdp } = positions[i];
  byId("position").value = String(i);
  byId("position-facts").replaceChildren(list(positionFacts(i)));
  const members = ofPosition[i];
  const far = daps.first + daps.step * (daps.bins - 0.5);
  const between = daps.azimuth.length > 1 ? (daps.azimuth[1] - daps.azimuth[0]) / 2 : 180;
  const [low, high] = [daps.azimuth[0] - between, daps.azimuth[daps.azimuth.length - 1] + between];
  const wrapped = (azimuth) => low + ((((azimuth - low) % 360) + 360) % 360);
  const dots = (kind, y, errors) => ({ name: "MPC", colour: "#c2185b", dots: true, hollow: true, points: kind.map((k) => [mpcs.delay[k], y(k), errors ? errors(k) : null]), tips: kind.map((k) => `${mpcName(k)}: ${useOf(k)}`), pick: (k) => choose("mpc", kind[k]) });
  const picked = mpc === null ? [] : [{ name: "chosen", colour: "#1a1a1a", dots: true, points: [[mpcs.delay[mpc], null]], tips: [mpcName(mpc)] }];
  const at = (y) => picked.map((one) => ({ ...one, points: [[mpcs.delay[mpc], y(mpc)]] }));
  const delays = { title: "delay [ns]", min: daps.first - daps.step / 2, max: far };
  chart(byId("daps"), {
    title: `DAPS of ${name}: ${daps.low} dB (dark) to ${daps.high} dB (bright), antenna included, ${daps.elevations}`,
    x: delays, y: { title: "azimuth [degree]", min: low, max: high, step: high - low > 180 ? 90 : 0 },
    image: { href: `data:image/png;base64,${daps.picture}`, x: [delays.min, delays.max], y: [low, high] },
    series: [dots(members, (k) => wrapped(mpcs.azimuth[k])), ...at((k) => wrapped(mpcs.azimuth[k]))],
  });
  const line = pdp.power.map((power, k) => [pdp.first + k * pdp.step, power]);
  const shown = pdp.power.filter((power) => power !== null && (pdp.floor === null || power > pdp.floor - 5));
  const axis = ends([...shown, pdp.floor, pdp.threshold, ...members.map((k) => mpcs.path_gain[k])].filter((value) => value !== null));
  const level = (value, text, dash) => (value === null ? [] : [{ name: text, colour: "#5a5a5a", line: true, dash, points: [[delays.min, value], [far, value]] }]);
  chart(byId("pdp"), {
    title: `PDP of ${name}: ${pdp.made}`, x: delays, y: { title: "path gain [dB]", ...axis },
    series: [
      { name: "PDP", colour: "#0062a3", line: true, points: line }, ...level(pdp.threshold, "threshold of MPCs", "6 4"), ...level(pdp.floor, "noise floor of a beam, median", "2 3"),
      dots(members, (k) => mpcs.path_gain[k], (k) => mpcs.path_gain_std[k]), ...at((k) => mpcs.path_gain[k]),
    ],
  });
}

/* Parameters: a row for each position. */
const { parameters } = data;
const rowOf = new Map(positions.map((one, i) => [one.name, i]));
const losOf = (row) => (rowOf.has(parameters.positions[row]) ? positions[rowOf.get(parameters.positions[row])].los : "not known");
const allRows = parameters.positions.map((_, row) => row);
const scaled = (text, unit) => (unit ? `${text} [${unit}]` : text);

function showLoss() {
  const column = parameters.columns.find((one) => one.key === "path_loss");
  if (!column) return byId("loss").replaceChildren("No position has a path loss.");
  const known = allRows.filter((row) => parameters.distance[row] > 0);
  const reach = ends(known.map((row) => Math.log10(parameters.distance[row])), 0.05);
  const x = { title: "distance [m]", log: true, min: 10 ** reach.min, max: 10 ** reach.max };
  const y = { title: "path loss [dB]", ...ends(known.map((row) => column.values[row])) };
  const series = Object.entries(GROUPS).flatMap(([los, [name, tone]]) => {
    const rows = known.filter((row) => losOf(row) === los);
    if (!rows.length) return [];
    const lines = data.fits.filter((fit) => fit.group === name).map((fit) => ({
      name: `${name}, ${fit.model}: ${number(fit.intercept, 1)} dB ${fit.exponent < 0 ? "−" : "+"} 10 · ${number(Math.abs(fit.exponent), 2)} lg d`, colour: tone, line: true, dash: fit.model.startsWith("close") ? null : "6 4",
      points: [x.min, x.max].map((distance) => [distance, fit.intercept + 10 * fit.exponent * Math.log10(distance)]),
    }));
    const points = rows.map((row) => [parameters.distance[row], column.values[row], column.errors[row]]);
    return [{ name, colour: tone, dots: true, points, tips: rows.map((row) => `${parameters.positions[row]}: ${withError(column.values[row], column.errors[row])} dB`), pick: (k) => pickRow(rows[k]) }, ...lines];
  });
  return chart(byId("loss"), { title: "Path loss over distance", x, y, series });
}

function showDistribution() {
  const column = parameters.columns[Number(byId("parameter").value)];
  if (!column) return;
  const series = Object.entries(GROUPS).flatMap(([los, [name, tone]]) => {
    const values = allRows.filter((row) => losOf(row) === los).map((row) => column.values[row]).filter((value) => value !== null).sort((a, b) => a - b);
    return values.length ? [{ name: `${name}, ${values.length} positions`, colour: tone, line: true, width: 2, points: values.flatMap((value, i) => [[value, i / values.length], [value, (i + 1) / values.length]]) }] : [];
  });
  chart(byId("distribution"), { title: `${column.name}: ${column.definition}`, x: { title: scaled(column.name, column.unit), ...ends(column.values) }, y: { title: "share of positions", min: 0, max: 1 }, series });
}

function showResponses() {
  for (const host of document.querySelectorAll(".response")) {
    const { frequency, response } = data.calibrations[Number(host.dataset.number)];
    if (frequency.length) chart(host, { title: "Gain of the chain over the band, relative to its mean", x: { title: "frequency from the carrier [MHz]", ...ends(frequency, 0) }, y: { title: "gain [dB]", ...ends(response) }, series: [{ colour: "#0062a3", line: true, points: frequency.map((value, i) => [value, response[i]]) }] });
  }
}

function pickRow(row) {
  const i = rowOf.get(parameters.positions[row]);
  if (i === undefined) return;
  choose("position", i);
  byId("position-section").scrollIntoView();
}

const map = drawMap(byId("map"), byId("map-tools"), { tip: named, choose, named });

table(byId("parameter-table"), {
  caption: "Positions and their parameters", rows: allRows, pick: pickRow,
  columns: [
    { label: "position", value: (row) => parameters.positions[row], text: (row) => parameters.positions[row] },
    { label: "line of sight", value: losOf, text: losOf },
    { label: "TX to RX [m]", value: (row) => parameters.distance[row], text: (row) => number(parameters.distance[row], 2) },
    ...parameters.columns.map((one) => ({ label: scaled(one.name, one.unit), title: one.definition, value: (row) => one.values[row], text: (row) => withError(one.values[row], one.errors[row], Number.isInteger(one.values[row]) ? 0 : 2) })),
  ],
});

table(byId("mpc-table"), {
  caption: "MPCs of all positions, each with its use on the map", rows: mpcs.position.map((_, i) => i),
  pick: (i) => { choose("mpc", i); byId("map-section").scrollIntoView(); },
  columns: [
    { label: "position", value: (i) => positionName(mpcs.position[i]), text: (i) => positionName(mpcs.position[i]) },
    ...[["delay", "ns"], ["azimuth", "degree"], ["elevation", "degree"], ["path_gain", "dB"]].map(([key, unit]) => ({ label: scaled(key.replace("_", " "), unit), value: (i) => mpcs[key][i], text: (i) => withError(mpcs[key][i], mpcs[`${key}_std`][i]) })),
    { label: "reflection loss [dB]", value: (i) => mpcs.loss[i], text: (i) => number(mpcs.loss[i], 1) },
    { label: "reflector or reason", value: useOf, text: useOf },
  ],
});

byId("position").append(...positions.map((one, i) => html("option", { value: i }, one.name)));
byId("position").addEventListener("change", (event) => choose("position", Number(event.target.value)));
byId("previous").addEventListener("click", () => choose("position", (chosen + positions.length - 1) % positions.length));
byId("next").addEventListener("click", () => choose("position", (chosen + 1) % positions.length));
byId("parameter").append(...parameters.columns.map((one, i) => html("option", { value: i }, one.name)));
byId("parameter").addEventListener("change", showDistribution);

function showCharts() {
  showLoss();
  showDistribution();
  showResponses();
}
choose("position", 0);
showCharts();
window.addEventListener("resize", () => { showPosition(chosen); showCharts(); });
