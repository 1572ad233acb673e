/* Views that are no curves of points: viscosity in time as a histogram, the phase map, a run against another. */

/* Which points the filters leave. */
const left_over = () => data.points.map((point, index) => ({ point, index })).filter(({ point }) => meets(point, varying()));

const CLEAR = 6;
let histograms = '';
/* How often each viscosity occurs in time, over the runs of the points that the filters leave. */
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
  /* At first no more than can be told apart: the last ones, which are neighbours on the axis that changes first. */
  const keys = list.map(curve => curve.key).join();
  if (keys !== histograms) list.forEach((curve, n) => { n < list.length - CLEAR ? hidden.add(curve.key) : hidden.delete(curve.key); });
  histograms = keys;
  legend(list, plot);
  const shown = list.filter(curve => !hidden.has(curve.key));
  if (shown.length < list.length) $('remark').textContent = `${shown.length} of ${list.length} histograms are shown: the others can be switched on below.`;
  const bins = shown.flatMap(curve => [...curve.counts.keys()]);
  const wide = data.histogram_bin;
  shown_table = { head: ['point', 'viscosity from', 'viscosity to', 'share of samples'], rows: shown.flatMap(c => [...c.counts].sort((a, b) => a[0] - b[0]).map(([bin, count]) => [c.label, 10 ** (bin * wide), 10 ** ((bin + 1) * wide), count / c.number])) };
  if (!bins.length) { nothing(svg, 'no samples after the strain discarded'); return; }
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
  $('note').textContent = 'How often a viscosity occurs in time, over all runs of a point, after the strain discarded; bins are even in its logarithm.';
}

/* Two axes of the grid as a map. */
function plot_map() {
  const svg = $('plot'), ax = $('map-x').value, ay = $('map-y').value, quantity = $('quantity').value;
  legend([], plot);
  const order = axis => values(axis).filter(v => v !== null).sort((a, b) => typeof a === 'string' && a !== 'inf' && b !== 'inf' ? a.localeCompare(b) : num(a) - num(b));
  const xs = ax ? order(ax) : [], ys = ay ? order(ay) : [];
  if (!ax || !ay || ax === ay || !xs.length || !ys.length) { nothing(svg, 'a map needs two axes with several values each'); return; }
  const cells = new Map();
  for (const { point, index } of left_over()) {
    const key = `${xs.indexOf(on(point, ax))} ${ys.indexOf(on(point, ay))}`;
    if (!key.includes('-')) (cells.get(key) ?? cells.set(key, []).get(key)).push({ point, index });
  }
  const mean = list => { const all = list.map(c => num(c.point[quantity])).filter(v => typeof v === 'number' && isFinite(v)); return all.length ? all.reduce((a, b) => a + b) / all.length : null; };
  const all = [...cells.values()].map(mean).filter(v => v !== null);
  const low = Math.min(...all), high = Math.max(...all), log = low > 0 && high > 10 * low;
  const part = v => high > low ? (log ? Math.log(v / low) / Math.log(high / low) : (v - low) / (high - low)) : .5;
  const width = narrow() ? 400 : 820, height = narrow() ? 380 : 480;
  const along = (axis, list) => ({ low: -.5, high: list.length - .5, ticks: list.map((v, at) => ({ at, name: value_of(axis, v) })) });
  const { X, Y, right, top } = frame(svg, width, height - 50, along(ax, xs), along(ay, ys), [AXIS[ax].label, AXIS[ay].label]);
  svg.setAttribute('viewBox', `0 0 ${width} ${height}`);
  shown_table = { head: [ax, ay, QUANTITIES[quantity], 'runs', 'jammed', 'failed'], rows: [] };
  const wide = X(1) - X(0), tall = Y(0) - Y(1), size = Math.min(wide, tall, 60) / 4;
  for (const [key, list] of [...cells].sort()) {
    const [i, j] = key.split(' ').map(Number), value = mean(list), sum = name => list.reduce((s, c) => s + (c.point[name] ?? 0), 0);
    const [cx, cy] = [X(i), Y(j)], paint = value === null ? 'var(--paper)' : heat(part(value));
    const group = draw('g', { class: list.some(c => c.index === chosen) ? 'point cell chosen' : 'point cell', 'data-index': list[0].index });
    group.append(draw('rect', { x: cx - wide / 2 + 1, y: cy - tall / 2 + 1, width: wide - 2, height: tall - 2, style: `fill:${paint}`, class: value === null ? 'empty' : 'full' }));
    const over = value !== null && part(value) > .55 ? '#111' : value === null ? 'var(--ink)' : '#fff';
    if (sum('jammed')) group.append(draw('path', { class: 'jammed', d: 'M-1-1L1 1M-1 1L1-1', transform: `translate(${cx - (sum('failed') ? size : 0)} ${cy}) scale(${size * .6})`, style: `stroke:${over};stroke-width:${3 / size}` }));
    if (sum('failed')) group.append(draw('text', { class: 'failed', x: cx + (sum('jammed') ? size : 0), y: cy + size * .7, 'text-anchor': 'middle', style: `fill:${over};font-size:${2 * size}px;font-weight:bold` }, '!'));
    group.append(draw('rect', { class: 'halo', x: cx - wide / 2 + 2, y: cy - tall / 2 + 2, width: wide - 4, height: tall - 4 }));
    const text = `${AXIS[ax].symbol} = ${value_in(ax, xs[i])}, ${AXIS[ay].symbol} = ${value_in(ay, ys[j])}\n${QUANTITIES[quantity]} ${show(value)}${list.length > 1 ? `, mean of ${list.length} points` : ''}\n${of_runs({ seeds: sum('seeds'), jammed: sum('jammed'), failed: sum('failed'), doubtful: sum('doubtful') })}`;
    shown_table.rows.push([xs[i], ys[j], value, sum('seeds'), sum('jammed'), sum('failed')]);
    walkable(svg, group, text, [cx, cy], width, () => choose(list[0].index));
  }
  /* What the colours mean. */
  const bar = 200, from = right - bar, at = height - 30;
  if (all.length) {
    for (let k = 0; k < 40; k++) svg.append(draw('rect', { x: from + k * bar / 40, y: at, width: bar / 40 + .5, height: 12, style: `fill:${heat((k + .5) / 40)}` }));
    for (const [place, v, anchor] of [[from, low, 'start'], [right, high, 'end']]) svg.append(draw('text', { x: place, y: at + 25, 'text-anchor': anchor }, show(v)));
    svg.append(draw('text', { x: from - 8, y: at + 10, 'text-anchor': 'end' }, QUANTITIES[quantity] + (log ? ', logarithmic' : '')));
  }
  $('note').textContent = 'Colour: mean over runs. × some runs jammed; ! some runs failed; no colour: no result. Choose a cell for its runs.';
}

/* A run against another, in time. */
function plot_versus() {
  const svg = $('plot'), pair = [$('run-a').value, $('run-b').value].map(key => data.runs.find(run => run.key === key)).filter(run => run);
  const list = pair.map((run, n) => ({ key: 'r' + n, n: n, label: run_name(run), colour: colour(n, 2), plain: true, run }));
  legend(list, plot);
  const shown = list.filter(curve => !hidden.has(curve.key));
  shown_table = { head: ['run', 'strain', data.viscosity_label], rows: shown.flatMap(c => c.run.trace.map(p => [c.run.key, ...p])) };
  if (!shown.some(c => c.run.trace.length > 1)) { nothing(svg, 'no samples yet'); return; }
  in_time(svg, shown.map(c => ({ trace: c.run.trace, colour: c.colour })), narrow() ? 340 : 440, Math.max(...pair.map(run => run.discard ?? 0)));
  $('note').textContent = 'Two runs in time; the strain discarded is shaded.';
}
const run_name = run => [name_of(data.points[run.point], varying()), `seed ${run.seed}`].filter(w => w).join(', ');

/* Viscosity in time. */
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
