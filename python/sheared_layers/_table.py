"""Tables for pandas and for notebooks."""

from html import escape

_SHOWN = 15  # rows at the beginning and at the end of a long table


def to_pandas(table):
    try:
        import pandas
        import pyarrow
    except ImportError as error:
        raise ImportError(f"to_pandas needs {error.name}: pip install 'sheared-layers[pandas]'") from None
    if hasattr(pandas.DataFrame, "from_arrow"):
        return pandas.DataFrame.from_arrow(table)
    return pyarrow.table(table).to_pandas()


def _cell(value):
    if value is None or value != value:
        return ""
    return f"{value:.4g}" if isinstance(value, float) else escape(str(value))


def to_html(table):
    units, meanings, count = table.units, table.meanings, len(table)
    heads = []
    for name in table.columns:
        about = ", ".join(text for text in (meanings.get(name), units.get(name)) if text)
        heads.append(f'<th title="{escape(about)}">{escape(name)}</th>')
    columns = [table[name].tolist() for name in table.columns]
    rows = ["<tr>" + "".join(f"<td>{_cell(value)}</td>" for value in row) + "</tr>" for row in zip(*columns)]
    if count > 2 * _SHOWN:
        rows[_SHOWN:-_SHOWN] = [f'<tr><td colspan="{len(columns)}">…</td></tr>']
    return (
        f"<table><thead><tr>{''.join(heads)}</tr></thead><tbody>{''.join(rows)}</tbody></table>"
        f"<p>{count} rows × {len(columns)} columns</p>"
    )
