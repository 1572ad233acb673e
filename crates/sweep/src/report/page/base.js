/* Shared by all parts of the page: data, elements, colours and markers, axes. */
const $ = id => document.getElementById(id);
const NS = 'http://www.w3.org/2000/svg';
let data = JSON.parse($('data').textContent);
const live = data.live;
const AXES = data.axes.map(a => a.key);
const AXIS = Object.fromEntries(data.axes.map(a => [a.key, a]));
const QUANTITIES = Object.fromEntries(data.quantities.map(q => [q.key, q.label]));
const hidden = new Set();
const chosenFilters = {};
let chosen = null;

const num = v => v === 'inf' ? Infinity : v;
const show = v => v === 'inf' || v === Infinity ? '∞' : v === null || v === undefined ? '–' : typeof v === 'number' ? String(+v.toPrecision(4)) : String(v);
/* A value and the half-width of its interval with the same decimals: two digits of the half-width. */
const with_half = (v, half) => {
  const decimals = half > 0 ? Math.max(0, 1 - Math.floor(Math.log10(+half.toPrecision(2)))) : 9;
  return typeof v !== 'number' || decimals > 6 ? show(v) + (half > 0 ? ` ± ${show(+half.toPrecision(2))}` : '') : `${v.toFixed(decimals)} ± ${half.toFixed(decimals)}`;
};
const build = (element, attributes, text) => {
  for (const [k, v] of Object.entries(attributes)) element.setAttribute(k, v);
  if (text !== undefined) element.textContent = text;
  return element;
};
const make = (tag, attributes = {}, text) => build(document.createElement(tag), attributes, text);
const draw = (tag, attributes = {}, text) => build(document.createElementNS(NS, tag), attributes, text);
/* At imposed stress the rate is a result, so it does not distinguish points. */
const on = (point, axis) => axis === 'shear_rate' && point.shear_stress != null ? null : point[axis];
const values = axis => [...new Set(data.points.map(p => on(p, axis)))];
const varying = () => AXES.filter(axis => values(axis).length > 1);
/* The area fraction or the volume fraction. */
const is_fraction = axis => axis === 'area_fraction' || axis === 'volume_fraction';
const fraction = () => data.points.some(p => p.volume_fraction) ? 'volume_fraction' : 'area_fraction';
const dilute = point => point.volume_fraction ? 1 + 5 * point.volume_fraction / 2 : 1 + 5 * point.area_fraction / 3;
const dark = window.matchMedia('(prefers-color-scheme: dark)');
const narrow = () => window.matchMedia('(max-width: 40rem)').matches;
const ink = name => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

/* The colour at a position from 0 to 1 of a map of increasing lightness. */
function along_map(map, part) {
  const at = Math.min(1, Math.max(0, part)) * (map.length - 1), below = Math.min(Math.floor(at), map.length - 2);
  const channels = hex => [1, 3, 5].map(i => parseInt(hex.slice(i, i + 2), 16));
  const [a, b] = [channels(map[below]), channels(map[below + 1])];
  return '#' + a.map((v, i) => Math.round(v + (at - below) * (b[i] - v)).toString(16).padStart(2, '0')).join('');
}
const heat = part => along_map(data.look.heat, part);
/* The colour of one of several curves: a fixed colour, or one of the map if there are too few. */
const colour = (n, number) => number > data.look.markers.length
  ? along_map(dark.matches ? data.look.heat.slice(2) : data.look.heat.slice(0, -1), n / (number - 1)) : `var(--c${n % data.look.markers.length})`;
const SHAPES = {
  square: 'M-.9-.9H.9V.9H-.9Z', triangle: 'M0-1.2L1.1.8H-1.1Z', diamond: 'M0-1.3L1.3 0L0 1.3L-1.3 0Z', 'triangle-down': 'M0 1.2L1.1-.8H-1.1Z',
  circle: 'M-1 0A1 1 0 1 1 1 0A1 1 0 1 1-1 0Z', cross: 'M-1-1L1 1M-1 1L1-1',
};
/* A marker of a curve. */
function marker(n, x, y, size, paint) {
  const name = data.look.markers[n % data.look.markers.length], hollow = name.startsWith('hollow-');
  return draw('path', { class: 'marker', d: SHAPES[name.replace('hollow-', '')], transform: `translate(${x} ${y}) scale(${size})`,
    style: `stroke:${paint};stroke-width:${1.4 / size};fill:${hollow ? 'var(--panel)' : paint}` });
}
/* The legend symbol of a curve. */
function swatch(n, paint, plain) {
  const svg = draw('svg', { class: 'swatch', viewBox: '0 0 28 14', 'aria-hidden': 'true' });
  svg.append(draw('line', { x1: 1, x2: 27, y1: 7, y2: 7, style: `stroke:${paint};stroke-width:2` }));
  if (!plain) svg.append(marker(n, 14, 7, 4.5, paint));
  return svg;
}

function ticks(low, high, log) {
  if (log) {
    const all = [];
    const wide = Math.log10(high / low) > 2.5;
    for (let e = Math.floor(Math.log10(low)); e <= Math.ceil(Math.log10(high)); e++)
      for (const m of wide ? [1] : [1, 2, 5]) { const t = m * 10 ** e; if (t >= low * 0.999 && t <= high * 1.001) all.push(t); }
    if (all.length > 1) return all;
  }
  const raw = (high - low) / 5 || 1, power = 10 ** Math.floor(Math.log10(raw));
  const step = (raw / power < 1.5 ? 1 : raw / power < 3.5 ? 2 : raw / power < 7.5 ? 5 : 10) * power;
  const all = [];
  for (let t = Math.ceil(low / step - 1e-9) * step; t <= high + 1e-9 * step; t += step) all.push(+t.toPrecision(12));
  return all;
}
/* Labels of the ticks of a linear axis, all with the same decimals. */
const evenly = list => {
  const words = list.map(t => String(+t.toPrecision(4))), decimals = Math.max(...words.map(word => word.includes('e') ? 9 : (word.split('.')[1] ?? '').length));
  return decimals > 6 ? words : list.map(t => t.toFixed(decimals));
};
const named = (list, log) => { const words = log ? list.map(t => String(+t.toPrecision(4))) : evenly(list); return list.map((at, n) => ({ at, name: words[n] })); };
const linear = (low, high) => ({ low, high, place: v => v, edges: [], ticks: named(ticks(low, high, false), false) });
/* Labels of decades: all as numbers, or all as powers. */
const decades = list => list.every(e => e > -4 && e < 5) ? list.map(e => String(+(10 ** e).toPrecision(3))) : list.map(e => `10${[...String(e)].map(c => c === '-' ? '⁻' : '⁰¹²³⁴⁵⁶⁷⁸⁹'[c]).join('')}`);

/* A frame with axes; returns the maps from values to coordinates. */
function frame(svg, width, height, x, y, labels) {
  svg.setAttribute('viewBox', `0 0 ${width} ${height}`);
  svg.replaceChildren();
  const heights = y.ticks ?? named(ticks(y.low, y.high, y.log), y.log);
  const left = Math.max(62, 34 + 7 * Math.max(...heights.map(t => t.name.length))), right = 14, top = 14, bottom = 46;
  const fy = y.log ? Math.log : v => v;
  const X = v => left + (v - x.low) / (x.high - x.low || 1) * (width - left - right);
  const Y = v => height - bottom - (fy(v) - fy(y.low)) / (fy(y.high) - fy(y.low) || 1) * (height - top - bottom);
  for (const t of heights) {
    svg.append(draw('line', { class: 'grid', x1: left, x2: width - right, y1: Y(t.at), y2: Y(t.at) }));
    svg.append(draw('text', { x: left - 6, y: Y(t.at) + 4, 'text-anchor': 'end' }, t.name));
  }
  for (const t of x.ticks) {
    svg.append(draw('line', { class: 'axis', x1: X(t.at), x2: X(t.at), y1: height - bottom, y2: height - bottom + 5 }));
    svg.append(draw('text', { x: X(t.at), y: height - bottom + 19, 'text-anchor': 'middle' }, t.name));
  }
  svg.append(draw('rect', { class: 'axis', x: left, y: top, width: width - left - right, height: height - top - bottom }));
  svg.append(draw('text', { x: (left + width - right) / 2, y: height - 8, 'text-anchor': 'middle' }, labels[0]));
  svg.append(draw('text', { x: 14, y: (top + height - bottom) / 2, 'text-anchor': 'middle', transform: `rotate(-90 14 ${(top + height - bottom) / 2})` }, labels[1]));
  return { X, Y, left, right: width - right, top, bottom: height - bottom };
}
/* A line of text where there is nothing to draw. */
function nothing(svg, text) {
  svg.setAttribute('viewBox', '0 0 720 120');
  svg.replaceChildren(draw('text', { x: 360, y: 60, 'text-anchor': 'middle' }, text));
}
/* Marks with a description, which arrow keys step through and Enter selects. */
function walkable(svg, group, text, at, width, choose_it) {
  const hint = () => {
    const tip = $('tip'), box = svg.getBoundingClientRect(), scale = box.width / width;
    tip.textContent = text; tip.hidden = false;
    tip.style.left = Math.max(0, Math.min(at[0] * scale + 12, box.width - tip.offsetWidth)) + 'px';
    tip.style.top = Math.max(0, at[1] * scale - tip.offsetHeight - 10) + 'px';
  };
  group.setAttribute('aria-label', text.replaceAll('\n', ', '));
  group.setAttribute('role', 'button');
  group.setAttribute('tabindex', svg.querySelector('.point') ? '-1' : '0');
  group.onmouseenter = group.onfocus = hint;
  group.onmouseleave = group.onblur = () => { $('tip').hidden = true; };
  group.onclick = choose_it;
  group.onkeydown = event => {
    if (event.key === 'Enter' || event.key === ' ') { event.preventDefault(); choose_it(); return; }
    const all = [...svg.querySelectorAll('.point')], place = all.indexOf(group);
    const next = { ArrowRight: place + 1, ArrowDown: place + 1, ArrowLeft: place - 1, ArrowUp: place - 1, Home: 0, End: all.length - 1 }[event.key];
    if (next !== undefined && all[next]) { event.preventDefault(); all.forEach(o => o.setAttribute('tabindex', '-1')); all[next].setAttribute('tabindex', '0'); all[next].focus(); }
  };
  svg.append(group);
}
/* Summary of the runs of a point. */
/* What the runs of a point do where they are not in steady state. */
const trend_of = p => p.ordering ? 'ordering' : p.not_steady ? 'not steady' : '';
const of_runs = p => `${p.seeds} runs${p.jammed ? `, ${p.jammed} jammed` : ''}${p.failed ? `, ${p.failed} failed` : ''}${p.doubtful ? `, ${p.doubtful} doubtful` : ''}${trend_of(p) && `, ${trend_of(p)}`}`;
/* A value on an axis with as few digits as distinguish it from the others, and with its unit if converted. */
const value_of = (axis, v) => AXIS[axis].names[v] ?? (typeof v === 'number' ? String(+v.toPrecision(AXIS[axis].digits)) : show(v));
const value_in = (axis, v) => value_of(axis, v) + (AXIS[axis].unit && typeof v === 'number' && v !== 0 ? ' ' + AXIS[axis].unit : '');
const heading_of = axis => AXIS[axis].symbol + (AXIS[axis].unit ? ` (${AXIS[axis].unit})` : '');
const name_of = (p, axes) => axes.map(a => AXIS[a].names[on(p, a)] ?? `${AXIS[a].symbol} = ${value_in(a, on(p, a))}`).join(', ');
