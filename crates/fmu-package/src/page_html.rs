//! Writes the page that runs the FMU: `documentation/index.html`, which contains the library as WebAssembly and the scripts in the
//! directory `page`.

use crate::content::ContentFile;
use anyhow::{Context, Result};
use base64::Engine as _;
use base64::prelude::BASE64_STANDARD as BASE64;
use flate2::Compression;
use flate2::write::DeflateEncoder;
use quick_xml::escape::escape;
use sha2::{Digest as _, Sha256};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::io::Write as _;

/// Name of the page in an FMU.
pub(crate) const PAGE: &str = "documentation/index.html";

/// The page for a model that does not have one.
const PLAIN: &str = include_str!("../page/page.html");
/// Placeholder for the section that runs the FMU, which the scripts insert. It is as high as the window, so that the rest of the page
/// does not move when the section appears. Until then it says what is to come; if scripts are disabled, it is only a note.
const SPACE: &str = concat!(
    "<div id=\"live\" style=\"min-height:100vh\"><p>The FMU starts here in a moment.</p>",
    "<noscript><style>#live{min-height:0!important}#live>p:first-child{display:none}</style>",
    "<p class=\"note\">If you enable scripts, this page runs the FMU here. The rest of the page is complete.</p></noscript></div>",
);
const BEGIN: &str = include_str!("../page/begin.js");
const STYLE: &str = include_str!("../page/live.css");
const SCRIPTS: [&str; 8] = [
    include_str!("../page/plot.js"),
    include_str!("../page/player.js"),
    include_str!("../page/fmu.js"),
    include_str!("../page/guide.js"),
    include_str!("../page/session.js"),
    include_str!("../page/fields.js"),
    include_str!("../page/plain.js"),
    include_str!("../page/live.js"),
];

/// Largest total size of the resources in a page, bytes.
const RESOURCE_LIMIT: u64 = 4 << 20;

/// The parts of an FMU that a browser runs.
#[derive(Clone)]
pub(crate) struct Runnable {
    /// The content of `modelDescription.xml` of FMI 2.0.
    pub description: String,
    /// The library, as a WebAssembly module.
    pub module: Vec<u8>,
}

/// Returns the page that runs the FMU. It contains the written page, if there is one, and the resources among the content.
pub(crate) fn page(
    written: Option<&str>,
    content: &[ContentFile],
    (title, about): (&str, &str),
    runnables: &[Runnable],
    scripts: &[&str],
) -> Result<Vec<u8>> {
    let page = match written {
        Some(page) => page.to_owned(),
        None => PLAIN.replace("{{ title }}", &escape(title)).replace("{{ description }}", &escape(about)),
    };
    let script = script(runnables, &Resources::of(content)?, scripts)?;
    Ok(with_script(&page, &script)?.into_bytes())
}

/// The files in the FMU's directory `resources`.
#[derive(Default)]
struct Resources {
    /// The files in the page, which the model can read: names, and contents that are compressed and in base 64.
    packed: BTreeMap<String, String>,
    /// Names of the files that are too large for the page.
    missing: Vec<String>,
}

impl Resources {
    /// Reads the files, the smallest first, up to [`RESOURCE_LIMIT`].
    fn of(content: &[ContentFile]) -> Result<Self> {
        let mut files = Vec::new();
        for file in content {
            if let Some(name) = file.name.strip_prefix("resources/") {
                let read = || format!("cannot read {}", file.path.display());
                files.push((fs::metadata(&file.path).with_context(read)?.len(), name.to_owned(), &file.path));
            }
        }
        files.sort();
        let mut resources = Self::default();
        let mut space_left = RESOURCE_LIMIT;
        for (size, name, path) in files {
            match space_left.checked_sub(size) {
                Some(left) => {
                    let bytes = fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
                    resources.packed.insert(name, BASE64.encode(deflated(&bytes)?));
                    space_left = left;
                }
                None => resources.missing.push(name),
            }
        }
        Ok(resources)
    }
}

/// Returns the script that runs the first FMU. It also contains the other FMUs, which the model's own `scripts` run.
fn script(runnables: &[Runnable], resources: &Resources, scripts: &[&str]) -> Result<String> {
    let mut text = "(() => {\n\"use strict\";\n".to_owned();
    // The scripts of a model stay unchanged, because a string of several lines may contain what looks like a comment.
    SCRIPTS.iter().for_each(|script| text += &without_comments(script));
    scripts.iter().for_each(|script| text += script);
    text += "live([\n";
    for Runnable { description, module } in runnables {
        let description = BASE64.encode(deflated(description.as_bytes())?);
        writeln!(
            text,
            "{{ description: \"{description}\", module: \"{}\" }},",
            BASE64.encode(deflated(module)?)
        )?;
    }
    let resources = serde_json::to_string(&(&resources.packed, &resources.missing))?;
    writeln!(text, "], ...{resources}).catch(showFailure);\n}})();")?;
    // Browsers do not normalize the line ends of a script that another script adds.
    Ok(text.replace("\r\n", "\n"))
}

/// Removes the comments that are lines of their own, a tenth of the size of the script in the page.
fn without_comments(script: &str) -> String {
    let mut in_comment = false;
    let is_code = |line: &&str| {
        let line = line.trim();
        let starts = line.starts_with("/**");
        let is_comment = in_comment || starts || line.starts_with("//");
        in_comment = (in_comment || starts) && !line.ends_with("*/");
        !is_comment
    };
    script.split_inclusive('\n').filter(is_code).collect()
}

/// Adds a script to the page, in compressed form.
fn with_script(page: &str, script: &str) -> Result<String> {
    let packed = BASE64.encode(deflated(script.as_bytes())?);
    let text = format!(
        "<style>\n{STYLE}</style>\n<script>\n{BEGIN}begin(\"{packed}\").catch(showFailure);\n</script>\n"
    );
    // The script comes last, after the elements that it changes.
    let end = page.rfind("</body>").unwrap_or(page.len());
    let begin = ["<main>", "<body>"].iter().find_map(|tag| Some(page.find(tag)? + tag.len())).unwrap_or(end);
    let (head, content, tail) = (&page[..begin], &page[begin..end], &page[end..]);
    Ok(with_policy(&format!("{head}{SPACE}{content}{text}{tail}"), script))
}

/// Adds a Content-Security-Policy to the page. It allows the scripts and style sheets of the page and the compressed script, which it
/// identifies by their hashes. Apart from these, the page can only load images.
fn with_policy(page: &str, compressed: &str) -> String {
    let hashes = |tag: &str, others: &[&str]| {
        let elements = elements(page, tag);
        let contents = elements.iter().chain(others);
        // Browsers normalize line ends.
        let hash = |content: &str| BASE64.encode(Sha256::digest(content.replace("\r\n", "\n")));
        contents.map(|content| format!(" 'sha256-{}'", hash(content))).collect::<String>()
    };
    let policy = format!(
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src 'self' file: data:; \
         script-src 'wasm-unsafe-eval'{}; style-src-elem{}; style-src-attr 'unsafe-inline'\">\n",
        hashes("script", &[compressed]),
        hashes("style", &[]),
    );
    let position = ["<meta charset=\"utf-8\">\n", "<head>\n", "<head>"].iter();
    let position = position.filter_map(|tag| Some(page.find(tag)? + tag.len())).next().unwrap_or(0);
    format!("{}{policy}{}", &page[..position], &page[position..])
}

/// Returns the contents of all elements of this name.
fn elements<'a>(page: &'a str, tag: &str) -> Vec<&'a str> {
    let (begin, end) = (format!("<{tag}"), format!("</{tag}>"));
    let mut found = Vec::new();
    let mut rest = page;
    while let Some(position) = rest.find(&begin) {
        let after = &rest[position + begin.len()..];
        let is_tag = after.starts_with(|c: char| c == '>' || c.is_ascii_whitespace());
        let content = after.find('>').map(|open| &after[open + 1..]).filter(|_| is_tag);
        let Some((content, length)) = content.and_then(|text| Some((text, text.find(&end)?))) else {
            rest = after;
            continue;
        };
        found.push(&content[..length]);
        rest = &content[length + end.len()..];
    }
    found
}

/// Compresses bytes in the format that browsers call `deflate-raw`.
fn deflated(bytes: &[u8]) -> Result<Vec<u8>> {
    let mut encoder = DeflateEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(bytes)?;
    Ok(encoder.finish()?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scripts_come_last_in_a_page() {
        let runnable =
            || Runnable { description: "<fmiModelDescription/>".to_owned(), module: b"\0asm".to_vec() };
        let resources = Resources {
            packed: [("a.csv".to_owned(), "AA".to_owned())].into(),
            missing: vec!["b".to_owned()],
        };
        let script = script(&[runnable(), runnable()], &resources, &["const ownScript = 1;\n"]).unwrap();
        let parts = ["async function live(", "const ownScript", "live([\n{ description: \""];
        assert!(parts.map(|part| script.find(part).unwrap()).is_sorted());
        assert_eq!(script.matches("\n{ description: \"").count(), 2);
        assert!(script.contains("\n], ...[{\"a.csv\":\"AA\"},[\"b\"]]).catch("));

        let page = with_script("<body><p>text</p></body></html>", &script).unwrap();
        assert!(page.contains(&format!("<body>{SPACE}<p>text</p><style>")));
        assert!(page.ends_with(".catch(showFailure);\n</script>\n</body></html>"));
    }

    #[test]
    fn comments_on_lines_of_their_own_are_removed() {
        let script = "/** A\n * b. */\nconst a = /** @type {A} */ (1); // c\n  // d\n/** E. */\n  b();\n";
        assert_eq!(without_comments(script), "const a = /** @type {A} */ (1); // c\n  b();\n");
        for script in SCRIPTS {
            // Code after the end of a comment would be lost.
            let ends = script.lines().filter(|line| line.trim().starts_with("/**")).map(str::trim);
            assert!(ends.filter(|line| line.contains("*/")).all(|line| line.ends_with("*/")));
        }
    }

    #[test]
    fn file_names_cannot_end_the_script() {
        let missing = vec!["</script><img src=x onerror=alert(8)>".to_owned()];
        let script = script(&[], &Resources { missing, ..Default::default() }, &[]).unwrap();
        let page = with_script("<body></body>", &script).unwrap();
        assert_eq!(page.matches("</script").count(), 1);
    }

    /// Each block is allowed by the hash of its bytes (Content Security Policy Level 3, section 2.3.1).
    #[test]
    fn the_policy_has_a_hash_for_each_block() {
        let page =
            "<head>\n<style>a</style></head><svg><style type=\"text/css\">b</style></svg><styled>c</styled>";
        let page = with_policy(&format!("{page}<script></script>"), "a");
        assert_eq!(page.matches("'sha256-").count(), 4);
        assert!(page.starts_with(
            "<head>\n<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none';"
        ));
        // printf a | openssl dgst -sha256 -binary | base64
        assert!(page.contains("style-src-elem 'sha256-ypeBEsobvcr6wjGzmiPcTaeG7/gUfE5yuYB3ha/uSLs=' "));
        // The hash of an empty script.
        assert!(page.contains(
            "script-src 'wasm-unsafe-eval' 'sha256-47DEQpj8HBSa+/TImW+5JCeuQeRkm5NMpJWZG3hSuFU=' \
             'sha256-ypeBEsobvcr6wjGzmiPcTaeG7/gUfE5yuYB3ha/uSLs=';"
        ));
    }

    #[test]
    fn large_resources_are_left_out_of_the_page() {
        let directory = tempfile::tempdir().unwrap();
        let file = |name: &str, size: u64| {
            let path = directory.path().join(name.replace('/', "-"));
            fs::File::create(&path).unwrap().set_len(size).unwrap();
            ContentFile { name: name.to_owned(), path }
        };
        let content = [
            file("resources/large", RESOURCE_LIMIT),
            file("resources/deep/small", 1),
            file("documentation/other", 1),
        ];
        let resources = Resources::of(&content).unwrap();
        assert_eq!(resources.packed.into_keys().collect::<Vec<_>>(), ["deep/small"]);
        assert_eq!(resources.missing, ["large"]);
    }

    #[test]
    fn a_model_without_a_page_gets_one() {
        let page = String::from_utf8(page(None, &[], ("A & B", "Two <models>"), &[], &[]).unwrap()).unwrap();
        assert!(page.contains("<h1>A &amp; B</h1>\n<p>Two &lt;models&gt;</p>") && page.contains("<script>"));
    }
}
