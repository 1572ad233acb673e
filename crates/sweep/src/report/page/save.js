/* Downloads of what is shown: CSV, SVG, PNG. */
let shown_table = { head: [], rows: [] }, traced_table = { head: [], rows: [] };

function save(name, address) {
  const link = make('a', { href: address, download: `${data.campaign}-${name}` });
  document.body.append(link);
  link.click();
  link.remove();
  document.dispatchEvent(new CustomEvent('saved', { detail: { name: link.download, address } }));
}
const cell_text = v => v === null || v === undefined ? '' : v === Infinity || v === 'inf' ? 'inf' : /[",\n]/.test(v) ? `"${String(v).replaceAll('"', '""')}"` : String(v);
const as_csv = table => [table.head, ...table.rows].map(row => row.map(cell_text).join(',')).join('\n') + '\n';
const coded = (type, text) => `data:${type};charset=utf-8,${encodeURIComponent(text)}`;

/* A drawing as a file of its own, with the values of the colours instead of their names. */
function alone(id) {
  const svg = $(id).cloneNode(true), [, , width, height] = svg.getAttribute('viewBox').split(' ').map(Number);
  build(svg, { xmlns: NS, width, height });
  const own = [...document.styleSheets].flatMap(sheet => [...sheet.cssRules]).map(rule => rule.cssText).filter(rule => /^(svg|\.halo|\.band|\.bars)/.test(rule)).join('\n');
  const style = draw('style', {}, `text{font-family:sans-serif}\n${own}`), back = draw('rect', { width, height, style: 'fill:var(--paper)' });
  svg.prepend(style, back);
  return new XMLSerializer().serializeToString(svg).replace(/var\((--[a-z0-9]+)\)/g, (_, name) => ink(name));
}
async function as_png(text) {
  const image = new Image();
  await new Promise((done, failed) => { image.onload = done; image.onerror = failed; image.src = coded('image/svg+xml', text); });
  const canvas = make('canvas', { width: 2.5 * image.width, height: 2.5 * image.height }), pen = canvas.getContext('2d');
  pen.drawImage(image, 0, 0, canvas.width, canvas.height);
  return canvas.toDataURL('image/png');
}
/* Buttons for the drawing and the data of the results, and for those of the runs of a point. */
for (const [id, name, numbers, of = ''] of [['plot', 'view', () => shown_table], ['trace', 'runs', () => traced_table, 'trace-']]) {
  $(`save-${of}csv`).onclick = () => save(name + '.csv', coded('text/csv', as_csv(numbers())));
  $(`save-${of}svg`).onclick = () => save(name + '.svg', coded('image/svg+xml', alone(id)));
  $(`save-${of}png`).onclick = async () => save(name + '.png', await as_png(alone(id)));
}
$('save-layer-png').onclick = () => save('layer.png', $('layer').toDataURL('image/png'));
$('save-points-csv').onclick = () => {
  const head = Object.keys(data.points[0] ?? {});
  save('points.csv', coded('text/csv', as_csv({ head, rows: data.points.map(p => head.map(k => p[k])) })));
};
