// A map whose points were computed beforehand: the one nearest to a click shows its root and its response.
// Responses are numbers of two digits of base 64, from -1 to 1 times their peak.
const DIGITS = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_";
const digit = new Map([...DIGITS].map((letter, value) => [letter, value]));
const decoded = (text, peak) => Array.from({ length: text.length / 2 }, (_, k) =>
  ((digit.get(text[2 * k]) * 64 + digit.get(text[2 * k + 1])) / 2047 - 1) * peak);
const written = (value, digits = 4) => {
  const size = Math.abs(value);
  const text = size === 0 || (size >= 1e-3 && size < 1e6) ? String(Number(value.toPrecision(digits))) : value.toExponential(digits - 1);
  return text.replace(/-/g, "−").replace(/e\+?(.*)$/, "×10^$1");
};
const steps = (low, high, count) => {
  const rough = (high - low) / count, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].find(factor => factor * power >= rough * 0.999) * power;
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(Number((k * step).toPrecision(12)));
  return found;
};
const drawn = (parent, name, attributes, text) => {
  const one = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) one.setAttribute(key, value);
  if (text !== undefined) one.textContent = text;
  parent.append(one);
};
for (const explorer of document.querySelectorAll(".explorer")) {
  const data = JSON.parse(explorer.querySelector("script").textContent);
  const map = explorer.querySelector(".map"), says = explorer.querySelector(".says"), mark = explorer.querySelector(".mark");
  const plot = explorer.querySelector(".response"), grid = plot.querySelector(".ticks");
  const across = v => 60 + 360 * (v - data.x[0]) / (data.x.at(-1) - data.x[0]);
  const upward = v => 350 - 340 * (v - data.y[0]) / (data.y.at(-1) - data.y[0]);
  for (const v of steps(data.x[0], data.x.at(-1), 6)) {
    drawn(map.querySelector(".ticks"), "path", { d: `M${across(v)} 350v5` });
    drawn(map.querySelector(".ticks"), "text", { x: across(v), y: 370, "text-anchor": "middle" }, written(v));
  }
  for (const v of steps(data.y[0], data.y.at(-1), 6)) {
    drawn(map.querySelector(".ticks"), "path", { d: `M60 ${upward(v)}h-5` });
    drawn(map.querySelector(".ticks"), "text", { x: 52, y: upward(v) + 4, "text-anchor": "end" }, written(v));
  }
  const passive = decoded(data.passive, data.passivePeak);
  let chosen = data.start;
  const show = () => {
    const [column, row] = chosen, [real, imaginary, roots, peak, text] = data.points[row * data.x.length + column];
    mark.setAttribute("transform", `translate(${across(data.x[column])} ${upward(data.y[row])})`);
    const root = imaginary ? `${written(real, 5)} ± ${written(imaginary, 5)}j` : written(real, 5);
    const verdict = roots < 0 ? "a root lies on the axis as far as can be told" : roots ? `unstable, ${roots} unstable root${roots > 1 ? "s" : ""}` : "stable";
    says.replaceChildren();
    const place = document.createElement("b");
    place.textContent = `${data.names[0]} = ${written(data.x[column])} ${data.units[0]}, ${data.names[1]} = ${written(data.y[row])} ${data.units[1]}`;
    const lines = [` — ${verdict}`, document.createElement("br"), `rightmost root ${root} (1/s, rad/s)`, document.createElement("br"),
      text ? `largest value in ${written(data.duration)} s: ${written(peak)} ${data.unit}` : "the response leaves the range of numbers"];
    says.append(place, ...lines);
    const values = decoded(text, peak), top = 1.08 * (Math.max(peak, text ? 0.2 * data.passivePeak : data.passivePeak) || 1);
    const height = v => 127.5 - 117.5 * v / top, time = k => 70 + 480 * k / (passive.length - 1);
    const line = curve => curve.map((v, k) => `${time(k).toFixed(1)},${Math.min(Math.max(height(v), 10), 245).toFixed(1)}`).join(" ");
    plot.querySelector(".loop").setAttribute("points", line(values));
    plot.querySelector(".passive").setAttribute("points", line(passive));
    grid.replaceChildren();
    for (const v of steps(-top, top, 6)) {
      drawn(grid, "path", { d: `M70 ${height(v)}h480`, class: "fine" });
      drawn(grid, "text", { x: 63, y: height(v) + 4, "text-anchor": "end" }, written(v));
    }
    for (const v of steps(0, data.duration, 6)) drawn(grid, "text", { x: 70 + 480 * v / data.duration, y: 264, "text-anchor": "middle" }, written(v));
  };
  const choose = (column, row) => {
    chosen = [Math.min(Math.max(column, 0), data.x.length - 1), Math.min(Math.max(row, 0), data.y.length - 1)];
    show();
  };
  map.addEventListener("click", event => {
    const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(map.getScreenCTM().inverse());
    choose(Math.round((at.x - 60) / 360 * (data.x.length - 1)), Math.round((350 - at.y) / 340 * (data.y.length - 1)));
  });
  map.addEventListener("keydown", event => {
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    if (!step) return;
    event.preventDefault();
    choose(chosen[0] + step[0], chosen[1] + step[1]);
  });
  show();
}
