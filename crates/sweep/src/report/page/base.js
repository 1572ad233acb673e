/* Shared by all parts of the page: data, elements, colours, figures. */
const $ = id => document.getElementById(id);
let data = JSON.parse($('data').textContent);
const live = data.live;
/* Index of the point whose runs are shown. */
let chosen = null;

const make = (tag, attributes = {}, text) => {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  if (text !== undefined) element.textContent = text;
  return element;
};
const dark = window.matchMedia('(prefers-color-scheme: dark)');
const ink = name => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

/* The colour at a position from 0 to 1 of a map of increasing lightness. */
function heat(part) {
  const at = Math.min(1, Math.max(0, part)) * (data.heat.length - 1), below = Math.min(Math.floor(at), data.heat.length - 2);
  const channels = hex => [1, 3, 5].map(i => parseInt(hex.slice(i, i + 2), 16));
  const [a, b] = [channels(data.heat[below]), channels(data.heat[below + 1])];
  return '#' + a.map((v, i) => Math.round(v + (at - below) * (b[i] - v)).toString(16).padStart(2, '0')).join('');
}

/* Shows a figure, which the page holds or else its server draws, or why there is none. */
async function show(id, held, address, name) {
  const picture = $(id), link = $('save-' + id);
  picture.dataset.asked = address;
  let svg = held, problem = '';
  if (held === true) {
    const answer = await fetch(address, { cache: 'no-store' }).catch(() => null);
    const text = answer ? await answer.text() : 'The server does not respond.';
    /* Another figure was requested in the meantime. */
    if (picture.dataset.asked !== address) return;
    [svg, problem] = answer?.ok ? [text, ''] : ['', text];
  }
  picture.hidden = link.hidden = !svg;
  $(id + '-problem').textContent = svg ? '' : problem || 'No results yet, or more curves than one figure shows: `sweep report --where` chooses points.';
  if (!svg) return;
  picture.src = link.href = 'data:image/svg+xml;charset=utf-8,' + encodeURIComponent(svg);
  picture.alt = name;
  link.download = `${data.campaign}-${name}.svg`;
}
/* Fills a selection, and keeps what was selected if it is still there. */
function options(select, entries) {
  const before = select.value;
  select.replaceChildren(...entries.map(([value, label]) => make('option', { value }, label)));
  if (entries.some(entry => entry[0] === before)) select.value = before;
}

/* The figure that is selected. */
function plot() {
  const figure = data.figures.find(figure => figure.name === $('figure').value) ?? { name: '', label: '', along: [] };
  const name_of = key => data.axes[key] ?? key;
  options($('along'), figure.along.map(([key]) => [key, name_of(key)]));
  $('along').closest('label').hidden = figure.along.length < 2;
  const along = $('along').value, held = figure.along.find(([key]) => key === along)?.[1];
  const asked = new URLSearchParams({ name: figure.name, along, where: $('where').value });
  return show('plot', held, 'figure.svg?' + asked, `${figure.label} against ${name_of(along)}`);
}
