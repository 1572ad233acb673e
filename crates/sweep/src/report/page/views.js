/* Other views: histograms of the viscosity over time, the phase map, two runs compared. */

/* The points that pass the filters. */
const left_over = () => data.points.map((point, index) => ({ point, index })).filter(({ point }) => meets(point, varying()));

const CLEAR = 6;
let histograms = '';
/* Histograms of the viscosity over time, of all runs of the points that pass the filters. */
function plot_histogram() {
  const svg = $('plot');
  const list = left_over().map(({ point, index }, n, all) => {
    const counts = new Map();
    let number = 0;
    for (const run of data.runs) if (run.point === index && run.histogram) run.histogram.counts.forEach((count, bin) => {
      const at = run.histogram.first + bin;
      counts.set(at, (counts.get(at) ?? 0) + count); number += count;
    });
    return { key: 'h' + index, n, label: name_of(point, varying()) || 'all runs', colour: colour(n, all.length), plain: true, counts, number, index };
  }).filter(curve => curve.number);
  /* Initially only as many as can be distinguished: the last ones, which are neighbours on the axis that varies fastest. */
  const keys = list.map(curve => curve.key).join();
  if (keys !== histograms) list.forEach((curve, n) => { n < list.length - CLEAR ? hidden.add(curve.key) : hidden.delete(curve.key); });
  histograms = keys;
  legend(list, plot);
  const shown = list.filter(curve => !hidden.has(curve.key));
  if (shown.length < list.length) $('remark').textContent = `${shown.length} of ${list.length} histograms are shown: switch on the others below.`;
  const bins = shown.flatMap(curve => [...curve.counts.keys()]);
  const wide = data.histogram_bin;
  shown_table = { head: ['point', 'viscosity from', 'viscosity to', 'share of samples'], rows: shown.flatMap(c => [...c.counts].sort((a, b) => a[0] - b[0]).map(([bin, count]) => [c.label, 10 ** (bin * wide), 10 ** ((bin + 1) * wide), count / c.number])) };
  if (!bins.length) { nothing(svg, 'no samples after the discarded strain'); return; }
  const low = Math.min(...bins), high = Math.max(...bins) + 1, most = Math.max(...shown.flatMap(c => [...c.counts.values()].map(v => v / c.number)));
  const width = narrow() ? 400 : 820, height = narrow() ? 340 : 440;
  const x = { low: low * wide, high: high * wide, ticks: ticks(10 ** (low * wide), 10 ** (high * wide), true).map(t => ({ at: Math.log10(t), name: String(+t.toPrecision(3)) })) };
  const { X, Y, left, bottom } = frame(svg, width, height, x, { low: 0, high: 1.06 * most }, [data.viscosity_label, 'share of samples']);
  for (const curve of shown) {
    let path = '', before = 0;
    for (let bin = low; bin <= high; bin++) {
      const share = (curve.counts.get(bin) ?? 0) / curve.number;
      if (bin === low) path = `M${left} ${bottom}`;
      path += `L${X(bin * wide).toFixed(1)} ${Y(before).toFixed(1)}L${X(bin * wide).toFixed(1)} ${Y(share).toFixed(1)}`;
      before = share;
    }
    svg.append(draw('path', { class: 'curve bars', d: path, style: `stroke:${curve.colour};fill:${shown.length < 5 ? curve.colour : 'none'}` }));
  }
  $('note').textContent = 'Distribution of the viscosity over time and over all runs of a point, without the discarded strain; all bins have the same width in the logarithm.';
}

/* Maps over two axes of the grid, one for each combination of values on the other axes that passes the filters. */
const MAPS = 12;
function plot_map() {
  const svg = $('plot'), ax = $('map-x').value, ay = $('map-y').value, quantity = $('quantity').value;
  legend([], plot);
  const order = axis => values(axis).filter(v => v !== null).sort((a, b) => typeof a === 'string' && a !== 'inf' && b !== 'inf' ? a.localeCompare(b) : num(a) - num(b));
  const xs = ax ? order(ax) : [], ys = ay ? order(ay) : [];
  if (!ax || !ay || ax === ay || !xs.length || !ys.length) { nothing(svg, 'a map needs two axes with several values each'); return; }
  const others = varying().filter(a => a !== ax && a !== ay), maps = new Map();
  for (const { point, index } of left_over()) {
    const name = name_of(point, others), place = [xs.indexOf(on(point, ax)), ys.indexOf(on(point, ay))], value = num(point[quantity]);
    if (place.includes(-1)) continue;
    (maps.get(name) ?? maps.set(name, []).get(name)).push({ point, index, place, value: typeof value === 'number' && isFinite(value) ? value : null });
  }
  const shown = [...maps].slice(0, MAPS), all = shown.flatMap(([, cells]) => cells).map(cell => cell.value).filter(v => v !== null);
  if (shown.length < maps.size) $('remark').textContent = `${shown.length} of ${maps.size} maps are shown: select values above to see the others.`;
  const low = Math.min(...all), high = Math.max(...all), log = low > 0 && high > 10 * low;
  const part = v => high > low ? (log ? Math.log(v / low) / Math.log(high / low) : (v - low) / (high - low)) : .5;
  const columns = narrow() || shown.length < 2 ? 1 : shown.length < 5 ? 2 : 3, head = shown.length > 1 ? 20 : 0;
  const width = narrow() ? 400 : 820, each = width / columns, tall = (narrow() ? 330 : columns > 1 ? .8 * each : 430) + head;
  const height = tall * Math.ceil(shown.length / columns) + 50;
  const along = (axis, list) => ({ low: -.5, high: list.length - .5, ticks: list.map((v, at) => ({ at, name: value_of(axis, v) })) });
  svg.replaceChildren();
  svg.setAttribute('viewBox', `0 0 ${width} ${height}`);
  shown_table = { head: [ax, ay, ...others, QUANTITIES[quantity], 'runs', 'jammed', 'failed', 'flow'], rows: [] };
  shown.forEach(([name, cells], n) => {
    const [left, top] = [n % columns * each, Math.floor(n / columns) * tall + head], ground = draw('g', { class: 'map', transform: `translate(${left} ${top})` });
    const { X, Y } = frame(ground, each, tall - head, along(ax, xs), along(ay, ys), [AXIS[ax].label, AXIS[ay].label]);
    if (head) ground.append(draw('text', { x: each / 2, y: 4, 'text-anchor': 'middle' }, name));
    svg.append(ground);
    const wide = X(1) - X(0), deep = Y(0) - Y(1), size = Math.min(wide, deep, 60) / 4;
    for (const { point, index, place, value } of cells.sort((a, b) => a.place[0] - b.place[0] || a.place[1] - b.place[1])) {
      const [cx, cy] = [left + X(place[0]), top + Y(place[1])], paint = value === null ? 'var(--paper)' : heat(part(value));
      const group = draw('g', { class: index === chosen ? 'point cell chosen' : 'point cell', 'data-index': index });
      group.append(draw('rect', { x: cx - wide / 2 + 1, y: cy - deep / 2 + 1, width: wide - 2, height: deep - 2, style: `fill:${paint}`, class: value === null ? 'empty' : 'full' }));
      const over = value !== null && part(value) > .55 ? '#111' : value === null ? 'var(--ink)' : '#fff';
      if (point.jammed) group.append(draw('path', { class: 'jammed', d: 'M-1-1L1 1M-1 1L1-1', transform: `translate(${cx - (point.failed ? size : 0)} ${cy}) scale(${size * .6})`, style: `stroke:${over};stroke-width:${3 / size}` }));
      if (point.failed) group.append(draw('text', { class: 'failed', x: cx + (point.jammed ? size : 0), y: cy + size * .7, 'text-anchor': 'middle', style: `fill:${over};font-size:${2 * size}px;font-weight:bold` }, '!'));
      if (trend_of(point)) group.append(draw('text', { class: 'trend', x: cx, y: cy + size * 1.8, 'text-anchor': 'middle', style: `fill:${over};font-size:${1.4 * size}px` }, trend_of(point)));
      const flow = data.flows[index];
      if (flow === 'discontinuous') group.append(draw('text', { class: 'discontinuous', x: cx, y: cy - size * .8, 'text-anchor': 'middle', style: `fill:${over};font-size:${1.6 * size}px` }, 'D'));
      group.append(draw('rect', { class: 'halo', x: cx - wide / 2 + 2, y: cy - deep / 2 + 2, width: wide - 4, height: deep - 4 }));
      const text = `${name_of(point, [ax, ay, ...others])}\n${QUANTITIES[quantity]} ${show(value)}\n${of_runs(point)}${flow ? '\n' + flow : ''}`;
      shown_table.rows.push([xs[place[0]], ys[place[1]], ...others.map(a => on(point, a)), value, point.seeds, point.jammed, point.failed, flow]);
      walkable(svg, group, text, [cx, cy], width, () => choose(index));
    }
  });
  /* The colour scale. */
  const bar = 200, right = width - 14, from = right - bar, at = height - 30;
  if (all.length) {
    for (let k = 0; k < 40; k++) svg.append(draw('rect', { x: from + k * bar / 40, y: at, width: bar / 40 + .5, height: 12, style: `fill:${heat((k + .5) / 40)}` }));
    for (const [place, v, anchor] of [[from, low, 'start'], [right, high, 'end']]) svg.append(draw('text', { x: place, y: at + 25, 'text-anchor': anchor }, show(v)));
    svg.append(draw('text', { x: from - 8, y: at + 10, 'text-anchor': 'end' }, QUANTITIES[quantity] + (log ? ', logarithmic' : '')));
  }
  $('note').textContent = 'Colour: mean over runs. × some runs jammed; ! some runs failed; D discontinuous thickening, d ln η/d ln σ ≥ 1; no colour: no result. Select a cell to see its runs.';
}

/* Two runs compared. */
function plot_versus() {
  const svg = $('plot'), pair = [$('run-a').value, $('run-b').value].map(key => data.runs.find(run => run.key === key)).filter(run => run);
  const list = pair.map((run, n) => ({ key: 'r' + n, n: n, label: run_name(run), colour: colour(n, 2), plain: true, run }));
  legend(list, plot);
  const shown = list.filter(curve => !hidden.has(curve.key));
  shown_table = { head: ['run', 'strain', data.viscosity_label], rows: shown.flatMap(c => c.run.trace.map(p => [c.run.key, ...p])) };
  if (!shown.some(c => c.run.trace.length > 1)) { nothing(svg, 'no samples yet'); return; }
  in_time(svg, shown.map(c => ({ trace: c.run.trace, colour: c.colour })), narrow() ? 340 : 440, Math.max(...pair.map(run => run.discard ?? 0)));
  $('note').textContent = 'Two runs against strain; the discarded strain is shaded.';
}
const run_name = run => [name_of(data.points[run.point], varying()), `seed ${run.seed}`].filter(w => w).join(', ');

/* Viscosity against strain. */
function in_time(svg, runs, height, discard) {
  const all = runs.flatMap(run => run.trace), ys = all.map(p => p[1]), xs = all.map(p => p[0]);
  const lowest = Math.min(...ys), highest = Math.max(...ys), log = lowest > 0 && highest > 10 * lowest;
  const end = Math.max(...xs), width = narrow() ? 400 : 820;
  const maps = frame(svg, width, height, linear(0, end), { log, low: log ? lowest * .9 : Math.min(0, lowest), high: highest * 1.06 }, ['strain', data.viscosity_label]);
  const { X, Y, left, top, bottom } = maps;
  if (discard > 0) {
    svg.append(draw('rect', { class: 'discarded', x: left, y: top, width: X(Math.min(discard, end)) - left, height: bottom - top }));
    svg.append(draw('text', { class: 'aside', x: left + 5, y: top + 14 }, 'discarded'));
  }
  for (const run of runs) svg.append(draw('polyline', { class: 'run', points: run.trace.map(p => `${X(p[0]).toFixed(1)},${Y(p[1]).toFixed(1)}`).join(' '), fill: 'none', style: `stroke:${run.colour}`, 'stroke-width': 1.2 }));
  return maps;
}
