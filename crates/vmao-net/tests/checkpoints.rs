//! A checkpoint comes back as it was, and nothing else is taken for one.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

mod bar_world;

use bar_world::{examples, scenes};
use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensors};
use std::ops::ControlFlow;
use std::sync::OnceLock;
use vmao_core::random::Stream;
use vmao_net::{Checkpoint, ContactNetwork, Device, Error, ModelKind, NetworkConfig, TrainingConfig, train};

fn checkpoint() -> &'static Checkpoint {
    static ONCE: OnceLock<Checkpoint> = OnceLock::new();
    ONCE.get_or_init(|| {
        let training = TrainingConfig { epochs: 1, ..TrainingConfig::small() };
        let examples = examples(&scenes(3, 10));
        train(ModelKind::Vmao, &NetworkConfig::small(), &training, &examples, 2, Device::Cpu, &mut |_| ControlFlow::Continue(()))
            .unwrap()
    })
}

/// The checkpoint's file with its tensors changed one by one; `None` leaves one out.
fn rewritten(change: impl Fn(&str, Vec<usize>, Vec<u8>) -> Option<(Dtype, Vec<usize>, Vec<u8>)>) -> Vec<u8> {
    let bytes = checkpoint().to_safetensors().unwrap();
    let file = SafeTensors::deserialize(&bytes).unwrap();
    let kept: Vec<_> = file
        .tensors()
        .into_iter()
        .filter_map(|(name, view)| change(&name, view.shape().to_vec(), view.data().to_vec()).map(|kept| (name, kept)))
        .collect();
    let views = kept.iter().map(|(name, (dtype, shape, data))| (name, TensorView::new(*dtype, shape.clone(), data).unwrap()));
    let (_, header) = SafeTensors::read_metadata(&bytes).unwrap();
    safetensors::serialize(views, header.metadata().clone()).unwrap()
}

#[track_caller]
fn refused(bytes: &[u8]) -> Error {
    Checkpoint::from_safetensors(bytes, &checkpoint().config_json().unwrap()).unwrap_err()
}

#[test]
fn it_comes_back_as_it_was_and_predicts_the_same() {
    let there = checkpoint();
    let bytes = there.to_safetensors().unwrap();
    let back = Checkpoint::from_safetensors(&bytes, &there.config_json().unwrap()).unwrap();
    assert_eq!(*there, back);
    assert_eq!(bytes, back.to_safetensors().unwrap());
    let scene = &scenes(8, 1)[0].example;
    let map = |checkpoint| ContactNetwork::load(checkpoint).map(&scene.points, &scene.colors, &[1.0, 0.0, -1.0]).unwrap();
    assert_eq!(map(there), map(&back));
}

#[test]
fn a_file_cut_short_or_garbled_is_refused() {
    let bytes = checkpoint().to_safetensors().unwrap();
    for cut in [0, 5, 100, bytes.len() - 1] {
        let error = refused(&bytes[..cut]);
        assert!(matches!(error, Error::NotSafetensors { bytes, .. } if bytes == cut), "{error}");
    }
    let longer = [&bytes[..], &[0]].concat();
    assert!(matches!(refused(&longer), Error::NotSafetensors { .. }));
}

#[test]
fn no_flipped_bit_of_weights_or_configuration_goes_unnoticed() {
    let there = checkpoint();
    let (bytes, config) = (there.to_safetensors().unwrap(), there.config_json().unwrap());
    let header = 8 + u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
    let mut stream = Stream::new(7, &[]);
    let somewhere = (0..300).map(|_| header + stream.index(bytes.len() - header));
    let places: Vec<usize> = (0..header).step_by(7).chain(somewhere).collect();
    let mut altered = 0;
    for place in places {
        let mut garbled = bytes.clone();
        garbled[place] ^= 1 << (place % 8);
        altered += usize::from(matches!(refused(&garbled), Error::Altered { .. }));
    }
    assert!(altered > 250, "{altered}: most weights stay finite when a bit flips");
    // Letters and digits of the configuration; a flip of its white space may mean nothing.
    let meant = (0..config.len()).filter(|&place| config.as_bytes()[place].is_ascii_alphanumeric());
    for place in meant {
        let mut garbled = config.clone().into_bytes();
        garbled[place] ^= 1;
        let garbled = String::from_utf8(garbled).unwrap();
        let error = Checkpoint::from_safetensors(&bytes, &garbled).map(|_| garbled);
        assert!(error.is_err(), "{error:?}");
    }
}

#[test]
fn hostile_headers_are_refused_without_their_memory() {
    let with_header = |length: u64, header: &str| [&length.to_le_bytes()[..], header.as_bytes()].concat();
    let whole = |header: &str| with_header(header.len() as u64, header);
    let tensor = r#""a":{"dtype":"F32","shape":[1],"data_offsets":[0,4]}"#;
    let long_name = format!(r#"{{"{}":{{}}}}"#, "x".repeat(1 << 20));
    for hostile in [
        with_header(u64::MAX, "{}"),
        with_header(99_999_999, "{}"),
        with_header(1 << 40, "{}"),
        whole(""),
        whole("{}"),
        whole("[]"),
        whole(&"[".repeat(100_000)),
        whole(&format!(r#"{{"a":{}"#, r#"{"b":"#.repeat(100_000))),
        whole(r#"{"a":{"dtype":"F32","shape":[4294967296,4294967296,2],"data_offsets":[0,0]}}"#),
        whole(r#"{"a":{"dtype":"F32","shape":[1],"data_offsets":[4,0]}}"#),
        whole(r#"{"a":{"dtype":"F32","shape":[18446744073709551615],"data_offsets":[0,18446744073709551615]}}"#),
        [whole(&format!("{{{tensor},{tensor}}}")), vec![0; 4]].concat(),
        whole(r#"{"__metadata__":{"vmao":"short"}}"#),
        whole(r#"{"__metadata__":{"vmao":"digest {\"config\":1}"}}"#),
        whole(&long_name),
    ] {
        let error = refused(&hostile).to_string();
        assert!(error.len() < 4000, "a message, not the file: {} bytes", error.len());
    }
}

#[test]
fn a_wrong_shape_names_the_tensor_and_both_shapes() {
    let bytes = rewritten(|name, mut shape, data| {
        if name == "decoder.head.weight" {
            shape.reverse();
            shape[0] /= 2;
            shape[1] *= 2;
        }
        Some((Dtype::F32, shape, data))
    });
    let error = refused(&bytes).to_string();
    assert!(error.starts_with("tensor `decoder.head.weight` is F32 [") && error.contains("expected F32 ["), "{error}");
    let integers =
        rewritten(|name, shape, data| Some((if name == "decoder.logits.bias" { Dtype::I32 } else { Dtype::F32 }, shape, data)));
    assert_eq!(refused(&integers).to_string(), "tensor `decoder.logits.bias` is I32 [2]; expected F32 [2]");
}

#[test]
fn a_missing_and_a_foreign_tensor_are_named() {
    let missing = rewritten(|name, shape, data| (name != "posterior.mean.bias").then_some((Dtype::F32, shape, data)));
    let error = refused(&missing).to_string();
    assert!(error.starts_with("the checkpoint has no tensor `posterior.mean.bias`; it has: decoder.context.bias, "), "{error}");
    let config = checkpoint().config_json().unwrap().replace("\"vmao\"", "\"top1\"");
    let as_top1 = Checkpoint::from_safetensors(&checkpoint().to_safetensors().unwrap(), &config).unwrap_err().to_string();
    assert!(as_top1.starts_with("tensor `decoder.up_conv.0.mlp.0.weight` is F32 ["), "{as_top1}");
}

#[test]
fn a_value_that_is_no_number_is_named_with_its_place() {
    let put = |tensor: &'static str, value: f32| {
        rewritten(move |name, shape, mut data| {
            if name == tensor {
                data[8..12].copy_from_slice(&value.to_le_bytes());
            }
            Some((Dtype::F32, shape, data))
        })
    };
    let error = refused(&put("scene.abstraction.1.mlp.0.weight", f32::NAN)).to_string();
    assert_eq!(error, "tensor `scene.abstraction.1.mlp.0.weight` holds NaN at element 2; expected finite values");
    let error = refused(&put("decoder.head.norm.running_var", -1.0)).to_string();
    assert!(error.ends_with("holds -1 at element 2; expected finite values of zero or more"), "{error}");
}

#[test]
fn a_configuration_that_is_not_ours_is_refused() {
    let bytes = checkpoint().to_safetensors().unwrap();
    let config = checkpoint().config_json().unwrap();
    let with =
        |from: &str, to: &str| Checkpoint::from_safetensors(&bytes, &config.replacen(from, to, 1)).unwrap_err().to_string();
    assert!(with("{", "").starts_with("the checkpoint's configuration cannot be read: "));
    assert!(with("\"kind\"", "\"sort\"").contains("unknown field `sort`"));
    assert_eq!(with("\"format\": 2", "\"format\": 3"), "format is 3; it must be 2");
    assert_eq!(
        with("\"beta\": 0.03", "\"beta\": 0.02"),
        "config.json has network.beta = 0.02, expected 0.03 as the file beside it says"
    );
    assert!(with("\"latent_size\": 3", "\"latent_size\": 0").starts_with("latent_size is 0"));
}
