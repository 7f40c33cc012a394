//! The findings as one page that needs nothing else: no network, no other file.

use super::curve::Measure;
use super::false_color::{COLORS, DECADES, ErrorScale};
use super::measure::PICTURE_SAMPLES;
use super::pictures::Shown;
use super::plot::{Axis, curves, for_page};
use super::tables::{self, Table};
use super::{Report, ReportError, SceneReport};
use std::fmt::Write;

const STYLE: &str = "\
:root{color-scheme:light dark;--ink:#1c1e22;--soft:#666b74;--line:#d9dce1;--ground:#fff;--card:#f6f7f9}
@media(prefers-color-scheme:dark){:root{--ink:#e7e9ed;--soft:#9aa1ac;--line:#363a42;--ground:#15171b;--card:#1d2026}}
*{box-sizing:border-box}
body{margin:0 auto;padding:2rem 1.25rem 4rem;max-width:68rem;background:var(--ground);color:var(--ink);\
font:16px/1.5 system-ui,sans-serif}
h1{font-size:1.7rem;margin:0 0 .25rem}h2{font-size:1.3rem;margin:2.5rem 0 .75rem}
h3{font-size:1rem;margin:1.75rem 0 .5rem}
p,li{max-width:52rem}.soft,ul.notes{color:var(--soft);font-size:.875rem}ul.notes{padding-left:1.1rem;margin:.5rem 0}
.wide{overflow-x:auto}
table{border-collapse:collapse;font-variant-numeric:tabular-nums;font-size:.9rem}
th,td{padding:.3rem .8rem;text-align:right;border-bottom:1px solid var(--line);white-space:nowrap}
thead th{white-space:normal;vertical-align:bottom;max-width:11rem}
th:first-child,td:first-child{text-align:left;padding-left:0}tbody th{font-weight:400}
tr.ours td,tr.ours th{font-weight:600}
.plot svg{width:100%;height:auto;max-width:780px;display:block}
.row{display:grid;grid-template-columns:repeat(auto-fill,minmax(15rem,1fr));gap:1rem}
figure{margin:0}figure img{width:100%;image-rendering:pixelated;display:block;border-radius:4px}
figure.sheet{max-width:34rem}figcaption{font-size:.875rem;color:var(--soft);margin-top:.25rem}
.columns{display:grid;grid-template-columns:repeat(3,1fr);max-width:34rem;font-size:.875rem;color:var(--soft)}
.scale{max-width:34rem;margin:.75rem 0;font-size:.8rem;color:var(--soft)}
.scale .bar{height:.8rem;border-radius:3px;border:1px solid var(--line)}
.scale .ends{display:flex;justify-content:space-between}
.warning{padding:.5rem .8rem;background:var(--card);border-left:3px solid #d55e00}
";

/// `index.html`.
///
/// # Errors
/// Never: writing to memory. In place of a curve that cannot be drawn stands why.
pub fn page(report: &Report) -> Result<String, ReportError> {
    let mut out = String::new();
    write_page(&mut out, report).map_err(|error| ReportError::Plot(error.to_string()))?;
    Ok(out)
}

fn write_page(out: &mut String, report: &Report) -> std::fmt::Result {
    let machine = &report.machine;
    let title = format!("Penumbra {}: speed and error", report.version);
    write!(
        out,
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\
         <title>{title}</title>\n<style>\n{STYLE}</style></head><body>\n<h1>{title}</h1>\n"
    )?;
    let on = format!(
        "Measured on {}, {} threads, {} ({}).",
        machine.processor, machine.threads, machine.isa, machine.system
    );
    writeln!(out, "<p class=\"soft\">{}</p>", escape(&on))?;
    if report.interrupted {
        writeln!(out, "<p class=\"warning\">Interrupted: not everything was measured.</p>")?;
    }
    writeln!(out, "<h2>Performance</h2>")?;
    write_table(out, &tables::performance(report))?;
    for scene in &report.scenes {
        write_scene(out, scene)?;
    }
    writeln!(out, "<h2>Is the noise number right?</h2>")?;
    write_table(out, &tables::noise(report))?;
    writeln!(out, "</body></html>")
}

fn write_scene(out: &mut String, scene: &SceneReport) -> std::fmt::Result {
    writeln!(out, "<h2>{}</h2>", escape(&scene.name))?;
    for measure in scene.measures() {
        if measure == Measure::Surfaces {
            writeln!(out, "<h3>Where no light is seen</h3>")?;
            writeln!(
                out,
                "<p class=\"soft\">The same pictures without the pixels that see a light directly: its bright \
                 outline hides what happens in the penumbra.</p>"
            )?;
        }
        for axis in [Axis::Seconds, Axis::Samples] {
            match curves(scene, axis, measure) {
                Ok(svg) => writeln!(out, "<div class=\"plot\">{}</div>", for_page(&svg))?,
                Err(why) => writeln!(out, "<p class=\"warning\">{}</p>", escape(&why.to_string()))?,
            }
        }
        write_table(out, &tables::methods(scene, measure))?;
    }
    let pictures = &scene.pictures;
    writeln!(out, "<h3>Ours after {PICTURE_SAMPLES} samples per pixel, and the reference</h3>")?;
    write_row(out, &pictures.shown)?;
    if !pictures.errors.is_empty() {
        writeln!(out, "<h3>Where the error is, after {PICTURE_SAMPLES} samples per pixel</h3>")?;
        write_row(out, &pictures.errors)?;
        if let Some(scale) = &pictures.scale {
            write_scale(out, scale)?;
        }
    }
    if let Some(crops) = &pictures.crops {
        let of = if scene.measures().len() > 1 { ", where no light is seen" } else { "" };
        writeln!(out, "<h3>Worst pixels of ours{of}</h3>")?;
        writeln!(
            out,
            "<div class=\"columns\"><span>ours</span><span>reference</span><span>error</span></div>"
        )?;
        let places: Vec<String> = pictures.worst.iter().map(|[x, y]| format!("{x},{y}")).collect();
        let caption = format!("From the top: around pixel {}.", places.join("; "));
        write_figure(out, crops, "sheet", &caption)?;
    }
    Ok(())
}

fn write_row(out: &mut String, pictures: &[Shown]) -> std::fmt::Result {
    writeln!(out, "<div class=\"row\">")?;
    for shown in pictures {
        write_figure(out, shown, "", &shown.title)?;
    }
    writeln!(out, "</div>")
}

fn write_figure(out: &mut String, shown: &Shown, class: &str, caption: &str) -> std::fmt::Result {
    writeln!(
        out,
        "<figure class=\"{class}\"><img width=\"{}\" height=\"{}\" alt=\"{}\" \
         src=\"data:image/png;base64,{}\" style=\"height:auto\"><figcaption>{}</figcaption></figure>",
        shown.size.x,
        shown.size.y,
        escape(&shown.title),
        base64(&shown.png),
        escape(caption)
    )
}

fn write_scale(out: &mut String, scale: &ErrorScale) -> std::fmt::Result {
    let colors: Vec<String> = COLORS.iter().map(|[r, g, b]| format!("rgb({r},{g},{b})")).collect();
    write!(
        out,
        "<div class=\"scale\"><div class=\"bar\" style=\"background:linear-gradient(90deg,{})\"></div>\
         <div class=\"ends\">",
        colors.join(",")
    )?;
    for decade in (0..=DECADES).rev() {
        write!(out, "<span>{:.0e}</span>", scale.most * 10f64.powi(-decade))?;
    }
    writeln!(
        out,
        "</div>RMS of the three channels in linear light; logarithmic; the same for all maps above.</div>"
    )
}

fn write_table(out: &mut String, table: &Table) -> std::fmt::Result {
    write!(out, "<div class=\"wide\"><table><thead><tr>")?;
    for cell in &table.head {
        write!(out, "<th>{}</th>", escape(cell))?;
    }
    writeln!(out, "</tr></thead><tbody>")?;
    for row in &table.rows {
        let ours = row.first().is_some_and(|name| name == super::methods::OURS);
        write!(out, "<tr{}>", if ours { " class=\"ours\"" } else { "" })?;
        for (i, cell) in row.iter().enumerate() {
            let tag = if i == 0 { "th" } else { "td" };
            write!(out, "<{tag}>{}</{tag}>", escape(cell))?;
        }
        writeln!(out, "</tr>")?;
    }
    writeln!(out, "</tbody></table></div><ul class=\"notes\">")?;
    for note in &table.notes {
        writeln!(out, "<li>{}</li>", escape(note))?;
    }
    writeln!(out, "</ul>")
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// RFC 4648, section 4.
fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for three in bytes.chunks(3) {
        let byte = |i: usize| u32::from(three.get(i).copied().unwrap_or(0));
        let bits = byte(0) << 16 | byte(1) << 8 | byte(2);
        for i in 0..4 {
            let letter = LETTERS[(bits >> (18 - 6 * i) & 63) as usize];
            text.push(if i <= three.len() { char::from(letter) } else { '=' });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_is_that_of_the_rfc() {
        for (plain, coded) in
            [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")]
        {
            assert_eq!(base64(plain.as_bytes()), coded);
        }
    }

    #[test]
    fn names_cannot_break_out_of_the_page() {
        assert_eq!(escape("<a href=\"x\">&"), "&lt;a href=&quot;x&quot;&gt;&amp;");
    }
}
