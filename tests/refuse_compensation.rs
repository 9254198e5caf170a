//! Bad input to `compensate`: exit 2, one message, no file under a final name. A case is a file in
//! tests/refuse/compensation: the message after `error: `, then `args:` and `part.npy:` with the
//! rows of a part, lowest first, or `part.stl:` with its lines.

use std::fs;
use std::path::Path;

use assert_cmd::Command;
use npyz::WriterBuilder;

fn write_part(path: &Path, rows: &str) {
    let rows: Vec<Vec<f32>> = rows
        .split(';')
        .map(|row| row.split_whitespace().map(|z| z.parse().expect("a height")).collect())
        .collect();
    let shape = [rows.len() as u64, rows[0].len() as u64];
    let file = fs::File::create(path).expect("a scratch file");
    let mut writer =
        npyz::WriteOptions::new().default_dtype().shape(&shape).writer(file).begin_nd().expect("a header");
    writer.extend(rows.into_iter().flatten()).expect("heights");
    writer.finish().expect("a file");
}

#[test]
fn every_case_is_refused_as_its_file_says() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/refuse/compensation");
    let mut cases: Vec<_> =
        fs::read_dir(folder).expect("cases").map(|entry| entry.expect("a case").path()).collect();
    cases.sort();
    assert!(cases.len() >= 8);
    for case in cases {
        let name = case.display();
        let text = fs::read_to_string(&case).expect("a case");
        let mut lines = text.lines();
        let message = lines.next().expect("a message");
        let scratch = tempfile::tempdir().expect("a scratch folder");
        let dir = scratch.path().display().to_string();
        let mut arguments = Vec::new();
        for line in lines {
            match line.split_once(": ") {
                Some(("args", words)) => {
                    arguments = words.split_whitespace().map(|word| word.replace("{dir}", &dir)).collect();
                }
                Some((file, lines)) if file.ends_with(".stl") => {
                    fs::write(scratch.path().join(file), lines.replace("; ", "\n")).expect("a scratch file");
                }
                Some((file, rows)) => write_part(&scratch.path().join(file), rows),
                None => panic!("{name}: {line}"),
            }
        }
        let before = fs::read_dir(scratch.path()).expect("a folder").count();
        let done =
            Command::cargo_bin("screenmill").expect("the program").args(&arguments).output().expect("a run");
        let said = String::from_utf8_lossy(&done.stderr).replace(&dir, "{dir}");
        assert_eq!(done.status.code(), Some(2), "{name}: {said}");
        assert_eq!(said.lines().next(), Some(format!("error: {message}").as_str()), "{name}");
        assert!(said.lines().count() <= 12, "{name}");
        assert_eq!(fs::read_dir(scratch.path()).expect("a folder").count(), before, "{name} left a file");
    }
}

/// A file may announce rows so wide that no band of them can be held: refused with the figures
/// before anything is taken. (Its text depends on the machine's memory, so it is no file's case.)
#[test]
fn more_memory_than_there_is_is_refused_with_the_figure() {
    let scratch = tempfile::tempdir().expect("a scratch folder");
    let part = scratch.path().join("part.npy");
    write_part(&part, "0 0 0");
    let bytes = fs::read(&part).expect("a file");
    let columns = 16_000_000u64;
    let header = bytes.len() - 12;
    let start = bytes[..header].windows(6).position(|w| w == b"'shape").expect("a shape");
    let shape = format!("'shape': (1, {columns}), }}");
    let mut head = bytes[..header].to_vec();
    assert!(start + shape.len() < header);
    head[start..start + shape.len()].copy_from_slice(shape.as_bytes());
    head[start + shape.len()..header - 1].fill(b' ');
    fs::write(&part, &head).expect("a scratch file");
    let file = fs::OpenOptions::new().write(true).open(&part).expect("a file");
    file.set_len(header as u64 + 4 * columns).expect("a sparse file");
    let closing = scratch.path().join("closing.npy");
    let done = Command::cargo_bin("screenmill")
        .expect("the program")
        .arg("compensate")
        .arg(&part)
        .args(["--cutter", "ball:30", "--pixel-mm", "0.01", "--quiet", "--closing"])
        .arg(&closing)
        .output()
        .expect("a run");
    let said = String::from_utf8_lossy(&done.stderr);
    assert_eq!(done.status.code(), Some(2), "{said}");
    // 16,003,000 positions in each of the row's 3,001 rows of positions and of eight rows beside them.
    assert!(said.starts_with("error: 16000000 columns under cutter ball:30 take 192.4 GB"), "{said}");
    assert!(said.contains("GB are free; hint: "), "{said}");
    assert!(!closing.exists());
}

/// A part of nothing but zeros, which takes no room on the disk but some seconds under a cutter.
#[test]
#[cfg(unix)]
fn an_interrupted_command_leaves_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let part = folder.path().join("part.npy");
    let shape = [20_000, 5_000];
    let mut file = fs::File::create(&part).expect("a scratch file");
    let options =
        npyz::WriteOptions::<f32>::new().dtype(npyz::DType::new_scalar("<f4".parse().expect("a type")));
    options.shape(&shape).writer(&mut file).write_header_only().expect("a header");
    let head = file.metadata().expect("a file").len();
    file.set_len(head + 4 * shape[0] * shape[1]).expect("a sparse file");
    for rest in [["compensate", "--cutter=ball:4", "--cl"], ["raster", "--step-mm=0.01", "--out"]] {
        let out = tempfile::tempdir().expect("a folder");
        let is_empty = || fs::read_dir(out.path()).expect("a folder").next().is_none();
        let program = std::process::Command::new(assert_cmd::cargo::cargo_bin("screenmill"))
            .args(rest)
            .arg(out.path().join("a.npy"))
            .arg(&part)
            .args(["--pixel-mm", "0.01", "--quiet", "--threads", "1"])
            .stderr(std::process::Stdio::piped())
            .spawn()
            .expect("started");
        while is_empty() {
            std::thread::sleep(std::time::Duration::from_millis(2));
        }
        let kill = std::process::Command::new("kill").args(["-INT", &program.id().to_string()]).status();
        assert!(kill.expect("sent").success());
        let ended = program.wait_with_output().expect("ended");
        assert_eq!(ended.status.code(), Some(2), "{rest:?}");
        let said = String::from_utf8_lossy(&ended.stderr);
        assert_eq!(said, "error: interrupted; nothing was written\n", "{rest:?}");
        assert!(is_empty(), "{rest:?}");
    }
}
